#!/bin/sh
# install.sh [--wheels DIR] [--prefix DIR] [--root DIR] [--uninstall]
# Installs the logger on Raspberry Pi OS or Debian (12 or later), to record from the next boot on. Safe to repeat.
#
#   --wheels DIR   install cellwalk and what Debian lacks from DIR (`make wheels`), without a network
#   --prefix DIR   folder of the program (default /opt/cellwalk)
#   --root DIR     install below DIR with this machine's Python, for tests
#   --uninstall    remove everything but the runs, the configuration and the user
set -eu

here=$(dirname "$(readlink -f "$0")")
packages="python3-venv python3-click python3-numpy python3-h5py python3-serial python3-pyproj python3-nmea2 python3-tornado python3-segno"
wheels='' prefix=/opt/cellwalk root='' uninstall=''

usage() { sed -n 's/^# \{0,1\}//; 2,8p' "$0"; }
say() { printf '%s\n' "install.sh: $*"; }
fail() { say "$*" >&2; exit 1; }

while [ $# -gt 0 ]; do
    case $1 in
        --wheels | --prefix | --root)
            [ $# -ge 2 ] || fail "$1 needs a folder"
            case $1 in
                --wheels) wheels=$(readlink -f "$2") ;;
                --prefix) prefix=$(readlink -m "$2") ;;
                --root) root=$(readlink -m "$2") ;;
            esac
            shift ;;
        --uninstall) uninstall=yes ;;
        -h | --help) usage; exit 0 ;;
        *) usage >&2; exit 2 ;;
    esac
    shift
done
[ -n "$root" ] || [ "$(id -u)" -eq 0 ] || fail "run this as root: sudo $0"
[ -z "$wheels" ] || [ -d "$wheels" ] || fail "no such folder: $wheels"

venv=$root$prefix
etc=$root/etc
units="fieldlogger.service fieldlogger-recover.service fieldlogger-page.service"

# whether systemd of this machine runs and is the target of the installation (not in a chroot)
running() { [ -z "$root" ] && [ -d /run/systemd/system ]; }

uninstall() {
    systemctl ${root:+--root="$root"} disable fieldlogger.service fieldlogger-page.service 2>/dev/null || true
    # shellcheck disable=SC2086  # one word for each unit
    if running; then systemctl stop $units 2>/dev/null || true; fi
    for unit in $units; do rm -f "$etc/systemd/system/$unit"; done
    rm -f "$etc/udev/rules.d/70-cellwalk.rules" "$etc/sysusers.d/cellwalk.conf" "$root/usr/local/bin/fieldlogger"
    [ ! -f "$venv/pyvenv.cfg" ] || rm -rf "$venv"
    reload
    say "done; the runs, /etc/cellwalk and the user cellwalk remain"
}

reload() {
    running || return 0
    systemctl daemon-reload
    udevadm control --reload
    udevadm trigger --subsystem-match=tty --subsystem-match=usb --subsystem-match=leds --action=add
}

debian_packages() {
    [ -z "$root$wheels" ] && command -v apt-get >/dev/null || return 0
    wanted=$packages
    # Debian 12 has no msgspec; where it is missing pip gets it
    if apt-cache show python3-msgspec >/dev/null 2>&1; then wanted="$packages python3-msgspec"; fi
    missing=''
    for package in $wanted; do
        dpkg-query -W -f '${db:Status-Abbrev}' "$package" 2>/dev/null | grep -q '^ii' || missing="$missing $package"
    done
    [ -n "$missing" ] || return 0
    say "installing$missing"
    # shellcheck disable=SC2086  # one word for each package
    DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends $missing ||
        say "Debian's packages cannot be installed (no network?); pip will install what is missing" >&2
}

program() {
    python3 -c 'import sys; sys.exit(sys.version_info < (3, 11))' || fail "Python 3.11 or later is needed"
    python3 -m venv --system-site-packages "$venv" || fail "no virtual environment: apt-get install python3-venv"
    # Debian's pyproj looks for its data below the virtual environment too
    if [ -d /usr/share/proj ]; then
        mkdir -p "$venv/share"
        ln -sfn /usr/share/proj "$venv/share/proj"
    fi
    # pip does not know Debian's h5py by this name, so test the import
    for module in click h5py msgspec numpy pynmea2 pyproj serial; do
        "$venv/bin/python" -c "import $module" 2>/dev/null && continue
        [ $module = serial ] && module=pyserial
        pip "$module" || fail "$module is missing; without a network give --wheels (README.md)"
    done
    if [ -n "$wheels" ]; then
        set -- cellwalk
    elif "$venv/bin/python" -c 'import hatchling' 2>/dev/null; then
        set -- --no-build-isolation "$here/.."
    else
        set -- "$here/.."
    fi
    # reinstalled: a newer state of the program may have the version of the old one
    pip --no-deps --force-reinstall "$@" || fail "the program cannot be installed; without a network give --wheels"
    "$venv/bin/fieldlogger" check >/dev/null || fail "the program does not work: $("$venv/bin/fieldlogger" check 2>&1)"
}

pip() {
    if [ -n "$wheels" ]; then set -- --no-index --find-links "$wheels" "$@"; fi
    "$venv/bin/pip" install --quiet --disable-pip-version-check "$@"
}

files() {
    install -d "$etc/systemd/system" "$etc/udev/rules.d" "$etc/sysusers.d" "$etc/cellwalk" "$root/usr/local/bin"
    for unit in $units; do
        sed "s|/opt/cellwalk|$prefix|" "$here/$unit" >"$etc/systemd/system/$unit"
        chmod 644 "$etc/systemd/system/$unit"
    done
    install -m 644 "$here/70-cellwalk.rules" "$etc/udev/rules.d"
    install -m 644 "$here/sysusers.conf" "$etc/sysusers.d/cellwalk.conf"
    ln -sfn "$prefix/bin/fieldlogger" "$root/usr/local/bin/fieldlogger"
    if [ ! -e "$etc/cellwalk/site.toml" ]; then install -m 644 "$here/site.toml" "$etc/cellwalk"; fi
}

people() {
    systemd-sysusers ${root:+--root="$root"} cellwalk.conf
    # the user who installs may read the runs and the ports
    if [ -z "$root" ] && [ -n "${SUDO_USER:-}" ] && [ "$SUDO_USER" != root ]; then
        usermod -aG cellwalk,dialout "$SUDO_USER"
    fi
}

if [ -n "$uninstall" ]; then
    uninstall
    exit 0
fi
debian_packages
program
files
people
systemctl ${root:+--root="$root"} --quiet enable fieldlogger.service fieldlogger-page.service
reload
if running; then systemctl try-restart fieldlogger.service fieldlogger-page.service; fi
sync
say "done; the next boot records with /etc/cellwalk/site.toml. To find the ports: sudo fieldlogger probe"
say "to start now: sudo systemctl start fieldlogger; to test: sudo fieldlogger doctor"
