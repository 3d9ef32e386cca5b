#!/bin/sh
# install.sh [DEB | FOLDER [PACKAGE]...] [--uninstall]
# Installs the logger on Raspberry Pi OS, Debian (12 or 13) or Ubuntu 24.04, to record from the next boot on. Safe to
# repeat.
#
#   (nothing)      build the package of this folder and install it, with a network
#   DEB            install this package, with a network if Debian's packages are missing
#   FOLDER         install from the packages that `make card-debs` put there, without a network; PACKAGE (default
#                  fieldlogger) names others of them
#   --uninstall    remove the program; the runs and the configuration remain
set -eu

here=$(dirname "$(readlink -f "$0")")
from='' packages='' uninstall=''

usage() { sed -n 's/^# \{0,1\}//; 2,10p' "$0"; }
say() { printf '%s\n' "install.sh: $*"; }
fail() { say "$*" >&2; exit 1; }

for argument; do
    case $argument in
        --uninstall) uninstall=yes ;;
        -h | --help) usage; exit 0 ;;
        -*) usage >&2; exit 2 ;;
        *) if [ -z "$from" ]; then from=$argument; else packages="$packages $argument"; fi ;;
    esac
done
[ -z "$from" ] || [ -e "$from" ] || fail "no such file or folder: $from"
[ "$(id -u)" -eq 0 ] || fail "run this as root: sudo $0"
command -v apt-get >/dev/null || fail "this machine has no apt-get: systemd/README.md, By hand"

apt() {
    DEBIAN_FRONTEND=noninteractive apt-get -q -y -o DPkg::Lock::Timeout=300 --no-install-recommends "$@"
}

# install_deb DEB: with what it needs of the machine's own sources. A fresh card has no lists of packages, and an old one
# may name packages that are gone. Without a network the lists stay as they are: all may be installed already.
install_deb() {
    if [ -z "$(find /var/lib/apt/lists -name '*_Packages*' 2>/dev/null)" ]; then update; fi
    apt install "$1" || { update && apt install "$1"; }
}

update() {
    apt -o APT::Update::Error-Mode=any update || say "apt cannot fetch all lists of packages: is there a network?" >&2
}

# from_folder FOLDER: apt takes what the machine lacks from there, and nothing from a network
from_folder() {
    [ -e "$1/Packages" ] || fail "$1 has no list of packages; make card-debs makes such a folder"
    # packages of another release would replace the machine's C library, and more
    # shellcheck source=/dev/null
    machine="$(. /etc/os-release && echo "$VERSION_CODENAME") $(dpkg --print-architecture)"
    [ "$(cat "$1/made-for")" = "$machine" ] || fail "$1 is for $(cat "$1/made-for"), and this machine is $machine"
    state=$(mktemp -d)
    mkdir "$state/lists" "$state/parts"
    echo "deb [trusted=yes] file:$(readlink -f "$1") ./" >"$state/sources.list"
    set -- -o "Dir::Etc::SourceList=$state/sources.list" -o "Dir::Etc::SourceParts=$state/parts" \
        -o "Dir::State::Lists=$state/lists" -o APT::Sandbox::User=root
    apt "$@" update
    # shellcheck disable=SC2086  # one word for each package
    apt "$@" install ${packages:-fieldlogger}
    rm -rf "$state"
}

from_checkout() {
    arch=$(dpkg --print-architecture)
    # compiled modules and lists of packages are kept for the next time
    CACHE=/var/cache/cellwalk DIST=/var/cache/cellwalk "$here/debian/build.sh" "$arch"
    install_deb /var/cache/cellwalk/fieldlogger_*_"$arch".deb
}

if [ -n "$uninstall" ]; then
    apt remove fieldlogger
    rm -rf /var/cache/cellwalk
    say "done; the runs in /var/lib/cellwalk and /etc/cellwalk remain"
    exit 0
fi
if [ -d "$from" ]; then
    from_folder "$from"
elif [ -n "$from" ]; then
    install_deb "$(readlink -f "$from")"
else
    from_checkout
fi
# the user who installs may read the runs and the ports
if [ -n "${SUDO_USER:-}" ] && [ "$SUDO_USER" != root ]; then usermod -aG cellwalk,dialout "$SUDO_USER"; fi
sync
say "done; the next boot records with /etc/cellwalk/site.toml. To find the ports: sudo fieldlogger probe"
say "to start now: sudo systemctl start fieldlogger; to test: sudo fieldlogger doctor"
