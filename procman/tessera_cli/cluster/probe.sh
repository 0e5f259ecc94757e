# Reports what a node has, in lines WORD VALUE that node_facts.py parses. Runs there in any POSIX shell and changes
# nothing. $1: Tessera's folder, absolute or from the home folder; the others: Debian packages.
folder="$1"
shift
cd || exit 1
each() { sed -e "s/^/$1 /"; }

echo "host $(uname -n)"
echo "architecture $(uname -m)"
# shellcheck disable=SC1091
[ ! -r /etc/os-release ] || (. /etc/os-release && echo "system $ID $VERSION_ID")
sed -n 's/^\(flags\|Features\)[[:space:]]*: */flags /p' /proc/cpuinfo | head -n 1
[ ! -r /proc/sys/net/core/rmem_max ] || each rmem_max </proc/sys/net/core/rmem_max
[ ! -r /proc/net/route ] || awk 'NR > 1 { print "route", $2, $8 }' /proc/net/route
for program in rsync apt-get; do
  if command -v "$program" >/dev/null; then echo "program $program"; fi
done
if [ $# -gt 0 ] && command -v dpkg-query >/dev/null; then
  dpkg-query -W -f='${db:Status-Status} ${Package}\n' "$@" 2>/dev/null | sed -n 's/^installed /package /p'
fi
cat "${TESSERA_KEYS:-${XDG_CONFIG_HOME:-$HOME/.config}/tessera}/trusted_keys" 2>/dev/null | each trusted

cd "$folder" 2>/dev/null || exit 0
echo "home $(pwd -P)"
[ ! -e .git ] || echo "git yes"
[ ! -r .tessera-deployed ] || each deployed <.tessera-deployed
[ ! -r .venv/.tessera-stamp ] || each python <.venv/.tessera-stamp
[ ! -r build/versions.json ] || each versions <build/versions.json
if [ -r build/.prebuilt ]; then
  echo "build current"
elif [ -e build/.built ]; then
  # deploy does not set the times of files, so that a file that it changed is newer than the last build.
  newer="$(find CMakeLists.txt modules lcmtypes procman tests -type f -newer build/.built \
    \( -name '*.cc' -o -name '*.h' -o -name '*.lcm' -o -name '*.in' -o -name CMakeLists.txt \) | head -n 1)"
  if [ -z "$newer" ]; then echo "build current"; else echo "build old"; fi
fi
for program in build/bin/tessera-*; do
  [ ! -x "$program" ] || ldd "$program" 2>/dev/null | sed -n 's/^[[:space:]]*\(.*\) => not found/library \1/p'
done | sort -u
