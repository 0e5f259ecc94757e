# Makes this machine ready: sourced by `tessera`, with $root set to the checkout. Every step looks first whether there
# is anything to do, says what it does and why, and keeps its output in logs/setup.log.

setup_log="$root/logs/setup.log"
wanted_rmem=4194304 # bytes: bursts of image tiles overflow the kernel's default receive buffer of 208 KiB

say() { printf '%s\n' "tessera: $*" >&2; }
fail() {
  say "$*"
  exit 1
}
usage_error() {
  say "$*"
  exit 2
}
on_terminal() { [ -t 0 ] && [ -t 2 ]; }

# log_step SENTENCE COMMAND...: runs it into the log; on failure shows the log's tail and says SENTENCE.
log_step() {
  local sentence="$1" status=0
  shift
  printf '\n== %s\n' "$*" >>"$setup_log"
  "$@" >>"$setup_log" 2>&1 </dev/null || status=$?
  if [ "$status" -ne 0 ]; then
    tail -n 25 "$setup_log" >&2
    fail "$sentence The whole output is in $setup_log."
  fi
}

# --- rights ---------------------------------------------------------------------------------------
# may_be_root REASON BY_HAND: whether commands may run as root now; asks once on a terminal. Says why not otherwise.
sudo_granted=""
may_be_root() {
  local reason="$1" by_hand="$2" answer=""
  [ "$(id -u)" -ne 0 ] || return 0
  [ -z "$sudo_granted" ] || return 0
  if ! command -v sudo >/dev/null; then
    say "$reason needs root, and sudo is not installed; as root, do: $by_hand"
    return 1
  fi
  if sudo -n true 2>/dev/null && ! on_terminal; then
    sudo_granted=yes
    return 0
  fi
  if ! on_terminal; then
    say "$reason needs root, and sudo wants a password but there is no terminal to ask; do: sudo $by_hand"
    return 1
  fi
  read -r -p "tessera: $reason needs sudo. Go on? [Y/n] " answer
  case "$answer" in
    "" | y | Y | yes) sudo -v && sudo_granted=yes && return 0 ;;
  esac
  say "Without it, do by hand: sudo $by_hand"
  return 1
}

as_root() {
  if [ "$(id -u)" -eq 0 ]; then "$@"; else sudo -n "$@"; fi
}

# --- steps ----------------------------------------------------------------------------------------
check_machine() {
  case "$(uname -m)" in
    x86_64)
      # The build's baseline, x86-64-v3, is the same for all nodes, so that they compute the same bits.
      local flag
      for flag in avx2 bmi2 fma; do
        grep -qw "$flag" /proc/cpuinfo || fail "this CPU lacks $flag, and Tessera needs x86-64-v3 (Intel Haswell of 2013, AMD Excavator of 2015, or later)."
      done
      ;;
    aarch64) ;;
    *) fail "this CPU is $(uname -m); Tessera is built for x86-64 and aarch64." ;;
  esac
  command -v apt-get >/dev/null && command -v dpkg-query >/dev/null ||
    fail "this system has no apt-get; Tessera is set up on Debian 12 or 13."
}

wanted_packages() { sed -e 's/#.*//' -e 's/[[:space:]]//g' -e '/^$/d' "$root/procman/packages.txt"; }

# missing_packages NAME...: those that are not installed.
missing_packages() {
  local wanted installed
  wanted="$(printf '%s\n' "$@" | sort)"
  # shellcheck disable=SC2086
  installed="$(dpkg-query -W -f='${db:Status-Status} ${Package}\n' $wanted 2>/dev/null | sed -n 's/^installed //p' | sort -u || true)"
  comm -23 <(printf '%s\n' "$wanted") <(printf '%s\n' "$installed")
}

# install_missing NAME...: of these packages.
install_missing() {
  local missing=()
  mapfile -t missing < <(missing_packages "$@")
  [ ${#missing[@]} -gt 0 ] || return 0
  say "These Debian packages are missing: ${missing[*]}"
  may_be_root "Installing them" "apt-get install -y ${missing[*]}" ||
    fail "Tessera can't be built without these packages."
  say "Installing them (some hundreds of megabytes; a few minutes)"
  log_step "apt-get update failed: is this machine online?" as_root apt-get update
  log_step "apt-get could not install the packages." \
    as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends \
    -o DPkg::Lock::Timeout=300 "${missing[@]}"
}

# make_python_env FOLDER REQUIREMENTS PURPOSE: unless the environment is there already, at this path and of these packages.
make_python_env() {
  local folder="$root/$1" requirements="$root/procman/$2" purpose="$3" place wanted have=""
  local stamp_file="$folder/.tessera-stamp"
  place="$root $(readlink -f /usr/bin/python3)"
  wanted="$place $(sha256sum <"$requirements")"
  [ ! -f "$stamp_file" ] || have="$(<"$stamp_file")"
  [ "$have" != "$wanted" ] || return 0
  case "$have" in
    "$place "*) ;;
    *)
      # A link leads to the environment of another checkout, which --clear would empty.
      [ ! -L "$folder" ] || rm "$folder"
      say "Making the Python environment $1, $purpose"
      log_step "The Python environment could not be made." /usr/bin/python3 -I -m venv --clear "$folder"
      ;;
  esac
  say "Installing the Python packages of procman/$2 into it"
  log_step "pip could not install the Python packages: is this machine online?" \
    "$folder/bin/python" -I -m pip install --disable-pip-version-check --no-deps --only-binary=:all: -r "$requirements"
  # So that the first run does not wait for it.
  log_step "The Python packages could not be compiled." "$folder/bin/python" -I -m compileall -q "$root/procman/tessera_cli"
  printf '%s\n' "$wanted" >"$stamp_file"
}

# add_viewer: what `tessera view` needs, into .venv, unless it is there already. Called by tessera_cli/viewing/window.py, once
# it is known that there is something to show.
add_viewer() {
  local requirements="$root/procman/requirements-view.txt" stamp_file="$root/.venv/.viewer-stamp" wanted have=""
  wanted="$(<"$root/.venv/.tessera-stamp") $(sha256sum <"$requirements")"
  [ ! -f "$stamp_file" ] || have="$(<"$stamp_file")"
  [ "$have" != "$wanted" ] || return 0
  exec 9>"$root/logs/.setup.lock"
  flock 9
  say "Installing the viewer, the package rerun-sdk (230 MB to download, once)"
  log_step "pip could not install the viewer: is this machine online? All other commands work without it." \
    "$root/.venv/bin/python" -m pip install --disable-pip-version-check --no-deps --only-binary=:all: -r "$requirements"
  # The viewer would send statistics of its use; tessera_cli/viewing/viewer_process.py names this folder of settings.
  log_step "The viewer's usage statistics could not be turned off." \
    env XDG_CONFIG_HOME="$root/.venv/etc" "$root/.venv/bin/rerun" analytics disable
  printf '%s\n' "$wanted" >"$stamp_file"
  finish_setup
}

# raise_receive_buffer ask|tell: `tell` only mentions a limit that is too small.
raise_receive_buffer() {
  local limit_file=/proc/sys/net/core/rmem_max conf=/etc/sysctl.d/60-tessera.conf limit
  local why="the kernel grants receive buffers of"
  [ -r "$limit_file" ] || return 0
  limit="$(<"$limit_file")"
  [ "$limit" -lt "$wanted_rmem" ] || return 0
  say "$why $limit bytes, and bursts of tiles need $wanted_rmem; smaller ones work, but messages get lost and sent again."
  if [ "$1" = ask ] && may_be_root "Raising net.core.rmem_max (kept in $conf)" "sysctl -w net.core.rmem_max=$wanted_rmem"; then
    if as_root sysctl -q -w "net.core.rmem_max=$wanted_rmem" 2>>"$setup_log"; then
      printf 'net.core.rmem_max = %s\n' "$wanted_rmem" | as_root tee "$conf" >/dev/null 2>>"$setup_log" || true
      say "Raised it."
      return 0
    fi
    say "This machine does not let it be raised (a container?); going on with the smaller buffer."
    return 0
  fi
  say "To raise it: sudo sysctl -w net.core.rmem_max=$wanted_rmem"
}

# Prints one line that follows ninja's progress; everything goes to the log.
follow_ninja() {
  local line told=0
  while IFS= read -r line; do
    printf '%s\n' "$line" >>"$setup_log"
    [[ "$line" =~ ^\[([0-9]+)/([0-9]+)\] ]] || continue
    local done_count=${BASH_REMATCH[1]} total=${BASH_REMATCH[2]}
    [ "$done_count" -gt 0 ] || continue  # it looks for new sources
    if [ -t 2 ]; then
      printf '\rtessera: Building: step %s of %s ' "$done_count" "$total" >&2
      told=1
    elif [ "$total" -gt 5 ] && [ $((done_count * 5 / total)) -gt "$told" ]; then
      told=$((done_count * 5 / total))
      say "Building: step $done_count of $total"
    fi
  done
  if [ -t 2 ] && [ "$told" -eq 1 ]; then printf '\n' >&2; fi
}

num_build_jobs() {
  # One heavy C++ file takes about a gigabyte.
  local cores gigabytes
  cores="$(nproc)"
  gigabytes=$(($(sed -n 's/^MemAvailable: *\([0-9]*\).*/\1/p' /proc/meminfo) / 1000000))
  [ "$gigabytes" -ge 1 ] || gigabytes=1
  echo $((cores < gigabytes ? cores : gigabytes))
}

# configure FOLDER OPTION...: makes CMake's build folder, unless it is there already and was made in the same way.
configure() {
  local folder="$root/$1" wanted have="" stamp_file="$root/$1/.tessera-stamp"
  shift
  wanted="$(<"$root/.venv/.tessera-stamp") $*"
  [ ! -f "$stamp_file" ] || have="$(<"$stamp_file")"
  [ "$have" != "$wanted" ] || return 0
  # A cache that was made at another path or against another Python can't be used again.
  rm -rf "$folder/CMakeCache.txt" "$folder/CMakeFiles"
  say "Configuring the build in ${folder#"$root"/}/"
  log_step "CMake could not configure the build." cmake -S "$root" -B "$folder" -G Ninja \
    -DCMAKE_CXX_COMPILER_LAUNCHER=ccache "$@"
  printf '%s\n' "$wanted" >"$stamp_file"
}

# build_in FOLDER TARGET...
build_in() {
  local folder="$root/$1" status=0
  shift
  printf '\n== ninja %s\n' "$*" >>"$setup_log"
  # CCACHE_BASEDIR, NOHASHDIR: what one checkout has compiled serves others, such as those that experiments build beside.
  CCACHE_SLOPPINESS=pch_defines,time_macros CCACHE_BASEDIR="$root" CCACHE_NOHASHDIR=1 ninja -C "$folder" -j "$(num_build_jobs)" "$@" 2>&1 </dev/null |
    follow_ninja || status=$?
  if [ "$status" -ne 0 ]; then
    grep -E -A 12 'FAILED:|error:|ninja: error' "$setup_log" | tail -n 25 >&2
    fail "The build failed. The whole output is in $setup_log."
  fi
}

# build TARGET...: in build/, optimized. Warnings are errors for continuous integration alone: the compiler of a user may
# warn of more than ours.
build() {
  # Brought whole by `tessera deploy --built` or `cmake --install`; a deploy of sources takes the mark away.
  [ ! -f "$root/build/.prebuilt" ] || return 0
  configure build -DCMAKE_BUILD_TYPE=Release -DCMAKE_COMPILE_WARNING_AS_ERROR="${TESSERA_WERROR:-OFF}"
  build_in build "$@"
  touch "$root/build/.built"
}

# prepare ask|tell: everything but the build. Two commands at once must not build into each other: the lock is held until
# the command calls `finish_setup`.
prepare() {
  mkdir -p "$root/logs" 2>/dev/null || true
  if ! { : >>"$root/logs/.setup.lock"; } 2>/dev/null; then
    fail "this checkout belongs to $(stat -c %U "$root"), and $(id -un) can't write into $root/logs: use a checkout of your own."
  fi
  exec 9>"$root/logs/.setup.lock"
  flock -n 9 || { say "Waiting for another tessera command that is setting up"; flock 9; }
  : >"$setup_log"
  check_machine
  # shellcheck disable=SC2046 # one word for each
  install_missing $(wanted_packages)
  make_python_env .venv requirements.txt "which brings LCM 1.5.3"
  raise_receive_buffer "$1"
}

finish_setup() { exec 9>&-; }

# setup_machine TARGET...: tells what it looks at.
setup_machine() {
  say "Looking at packages, Python environment, network buffer and build"
  prepare ask
  build "$@"
  finish_setup
}

# setup_quietly TARGET...: for commands that only want to start. Asks on the first time, and says nothing when there is
# nothing to do.
setup_quietly() {
  if [ -f "$root/build/.tessera-stamp" ] || [ -f "$root/build/.prebuilt" ]; then prepare tell; else prepare ask; fi
  build "$@"
  finish_setup
}
