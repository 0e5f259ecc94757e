#!/usr/bin/env bash
# Tries the checkout on a bare Debian, as somebody who has just cloned it:
#
#   .ci/bare_debian.sh [--data DIR] [--keep DIR] 12|13 COMMAND...
#   .ci/bare_debian.sh 13 demo
#
# Makes a minimal system with debootstrap, clones the last commit into it for an ordinary user who may use sudo, to a
# path with a space, and runs `procman/tessera COMMAND...` there. Every line of its output comes with the seconds since the
# command began, so the time of each phase can be read off. Ends with the command's exit status and removes the system.
#
#   --data DIR   shows DIR read-only where tests look for sequences (../shared/data)
#   --keep DIR   copies the logs of the runs (logs/) to DIR
#
# Needs root and debootstrap. Minimal systems are kept as tar files in $TESSERA_BARE (default /var/tmp/tessera-bare) and
# used again. This machine's CA certificates and pip settings hold inside too.
set -euo pipefail

say() { printf '%s\n' "bare_debian: $*" >&2; }
fail() {
  say "$*"
  exit 2
}

checkout="$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd -P)"
store="${TESSERA_BARE:-/var/tmp/tessera-bare}"
user=newcomer
data="" keep=""
while [ $# -gt 0 ]; do
  case "$1" in
    --data) data="$(readlink -f -- "$2")" && shift 2 ;;
    --keep) keep="$(readlink -m -- "$2")" && shift 2 ;;
    *) break ;;
  esac
done
[ $# -ge 2 ] || fail "usage: .ci/bare_debian.sh [--data DIR] [--keep DIR] 12|13 COMMAND..."
case "$1" in
  12) suite=bookworm ;;
  13) suite=trixie ;;
  *) fail "Debian $1 is not known; use 12 or 13." ;;
esac
shift
[ "$(id -u)" -eq 0 ] || fail "run it as root: it makes a system in a chroot."
command -v debootstrap >/dev/null || fail "debootstrap is missing; do: apt-get install debootstrap"

# make_tar: a minimal system with a user who may use sudo without a password.
make_tar() {
  local folder
  mkdir -p "$store"
  folder="$(mktemp -d "$store/new-$suite.XXXX")"
  chmod 755 "$folder"
  debootstrap --variant=minbase --include=sudo,ca-certificates "$suite" "$folder" >"$store/$suite.log" 2>&1 ||
    fail "debootstrap failed; its output is in $store/$suite.log and $folder/debootstrap."
  chroot "$folder" useradd --create-home --shell /bin/bash "$user"
  echo "$user ALL=(ALL) NOPASSWD: ALL" >"$folder/etc/sudoers.d/$user"
  tar -C "$folder" -cf "$store/$suite.tar.part" .
  mv "$store/$suite.tar.part" "$store/$suite.tar"
  rm -rf --one-file-system "$folder"
}

# Names, certificates and settings of this machine by which apt and pip reach their servers.
copy_network_settings() {
  local file
  for file in /etc/resolv.conf /etc/hosts /etc/pip.conf; do
    [ ! -r "$file" ] || cp -L "$file" "$system$file"
  done
  [ ! -r /etc/ssl/certs/ca-certificates.crt ] || cp -L /etc/ssl/certs/ca-certificates.crt "$system/etc/host-certificates.crt"
  for file in /etc/apt/apt.conf.d/*; do
    case "$(<"$file")" in *Acquire::*) cp "$file" "$system/etc/apt/apt.conf.d/" ;; esac
  done
}

# Mounts are made in a name space of their own, so that they are gone when the command has ended, with all processes.
run_inside() {
  local in_namespaces='
    mount -t proc proc "$1/proc"
    mount --rbind /dev "$1/dev"
    [ -z "$2" ] || mount --bind -o ro "$2" "$3"
    exec chroot "$1" sudo -u "$4" -H env \
      PIP_CERT=/etc/host-certificates.crt SSL_CERT_FILE=/etc/host-certificates.crt LANG=C.UTF-8 "${@:5}"'
  unshare --mount --propagation private --pid --fork --kill-child bash -euc "$in_namespaces" bash \
    "$system" "$data" "$system/home/$user/shared/data" "$user" "$@"
}

# Puts the seconds since its start in front of each line.
with_seconds() {
  local line begin=$SECONDS
  while IFS= read -r line; do printf '%5d s  %s\n' $((SECONDS - begin)) "$line"; done
}

# --- a system, the checkout in it, the command -----------------------------------------------------
begin=$SECONDS
if [ ! -f "$store/$suite.tar" ]; then
  say "making a minimal $suite (once)"
  make_tar
fi
system="$(mktemp -d "$store/$suite.XXXX")"
trap 'rm -rf --one-file-system "$system"' EXIT
tar -C "$system" -xf "$store/$suite.tar"
copy_network_settings
clone="/home/$user/a clone"
git clone -q --no-hardlinks "file://$checkout" "$system$clone"
mkdir -p "$system/home/$user/shared/data"
chown -R --reference="$system/home/$user" "$system/home/$user"
say "$suite with a clone of $(git -C "$checkout" rev-parse --short=12 HEAD) is ready after $((SECONDS - begin)) s: $*"

status=0
run_inside bash -c 'cd "$0" && exec procman/tessera "$@"' "$clone" "$@" 2>&1 </dev/null | with_seconds || status=$?
if [ -n "$keep" ]; then
  mkdir -p "$keep"
  cp -r "$system$clone/logs/." "$keep"
fi
say "procman/tessera $* on $suite ended with status $status"
exit "$status"
