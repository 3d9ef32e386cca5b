#!/bin/sh
# build.sh [ARCH]... : builds dist/fieldlogger_VERSION_ARCH.deb (default: amd64 arm64 armhf). `make deb` calls it.
# Each package serves Debian 12 and 13, Raspberry Pi OS made of them, and Ubuntu 24.04 (not armhf): the logger is pure
# Python and takes their libraries; only msgspec is compiled code (msgspec.sh). Equal sources give equal packages.
# Several architectures are built one by one: where one fails, the others are built all the same.
set -eu
here=$(dirname "$(readlink -f "$0")")
repository=$(readlink -f "$here/../..")
. "$here/suites.sh"
# install.sh names others, since root must not leave files in a user's checkout
cache=${CACHE:-$repository/.venv/deb}
dist=${DIST:-$repository/dist}
[ $# -gt 0 ] || set -- amd64 arm64 armhf
umask 022

# tools ARCH: what the build needs from Debian; as root it is installed
tools() {
    wanted="binutils dpkg-dev python3-venv debian-archive-keyring"
    triplet=$(triplet_of "$1")
    cross=-$(echo "$triplet" | tr _ -) library=libc6-dev-$1-cross
    if [ "$1" = "$(dpkg --print-architecture)" ]; then cross='' library=libc6-dev; fi
    wanted="$wanted binutils$cross"
    [ -n "$(machine_of "$1")" ] || wanted="$wanted gcc$cross $library"
    missing=''
    for package in $wanted; do
        dpkg-query -W -f '${db:Status-Abbrev}' "$package" 2>/dev/null | grep -q '^ii' || missing="$missing $package"
    done
    [ -n "$missing" ] || return 0
    if [ "$(id -u)" -ne 0 ]; then
        echo "make deb: first sudo apt-get install$missing" >&2
        exit 1
    fi
    apt-get update -qq >&2
    # shellcheck disable=SC2086  # one word for each package
    DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends $missing >&2
}

# a commit is newer than all before it, also between releases
version() {
    release=$(sed -n 's/^version = "\(.*\)"/\1/p' "$repository/pyproject.toml")
    if ! git -C "$repository" rev-parse -q --verify HEAD >/dev/null 2>&1; then
        SOURCE_DATE_EPOCH=$(stat -c %Y "$repository/pyproject.toml")
        version=$release
    elif [ -n "$(git -C "$repository" status --porcelain -uno)" ]; then
        SOURCE_DATE_EPOCH=$(date +%s)
        version=$release+$(date -u +%Y%m%d%H%M%S).edited
    else
        SOURCE_DATE_EPOCH=$(git -C "$repository" log -1 --format=%ct)
        version=$release+$(date -u -d "@$SOURCE_DATE_EPOCH" +%Y%m%d%H%M%S).$(git -C "$repository" rev-parse --short=7 HEAD)
    fi
    version=${VERSION:-$version}
    export SOURCE_DATE_EPOCH
}

program() {
    install -d "$root/usr/bin" "$root/usr/lib/fieldlogger/cellwalk-$version.dist-info"
    install -m 755 "$here/fieldlogger" "$root/usr/bin/fieldlogger"
    tar -C "$repository" --exclude=__pycache__ -c logger | tar -C "$root/usr/lib/fieldlogger" -x --no-same-owner
    # a run states the version that recorded it, which this file's folder names
    printf 'Metadata-Version: 2.1\nName: cellwalk\nVersion: %s\n' "$version" \
        >"$root/usr/lib/fieldlogger/cellwalk-$version.dist-info/METADATA"
    "$here/msgspec.sh" "$cache" "$1" "$root/usr/lib/fieldlogger"
}

system_files() {
    units=$root/usr/lib/systemd/system
    install -d "$units" "$root/usr/lib/udev/rules.d" "$root/usr/lib/sysusers.d" "$root/usr/share/fieldlogger" \
        "$root/usr/share/python3/runtime.d"
    install -m 644 "$here"/../*.service "$units"
    install -m 644 "$here/../70-cellwalk.rules" "$root/usr/lib/udev/rules.d"
    install -m 644 "$here/../sysusers.conf" "$root/usr/lib/sysusers.d/fieldlogger.conf"
    install -m 644 "$here/../site.toml" "$here/new_settings.py" "$root/usr/share/fieldlogger"
    install -m 755 "$here/rtupdate" "$root/usr/share/python3/runtime.d/fieldlogger.rtupdate"
}

documentation() {
    doc=$root/usr/share/doc/fieldlogger
    install -d "$doc" "$root/usr/share/man/man1"
    install -m 644 "$here/../README.md" "$here/copyright" "$doc"
    {
        printf 'fieldlogger (%s) stable; urgency=medium\n\n' "$version"
        printf '  * CHANGELOG.md of cellwalk says what is new.\n\n'
        printf ' -- %s  %s\n' "$(sed -n 's/^Maintainer: //p' "$here/control")" "$(date -u -R -d "@$SOURCE_DATE_EPOCH")"
    } | gzip -9n >"$doc/changelog.gz"
    gzip -9nc "$repository/CHANGELOG.md" >"$doc/CHANGELOG.md.gz"
    "$cache/venv/bin/python" "$here/from_commands.py" "$root/usr/share" "$version"
    gzip -9n "$root"/usr/share/man/man1/*.1
}

# control ARCH: with the C library that the compiled files ask for
control() {
    install -d "$root/DEBIAN"
    glibc=$(objdump -T "$root"/usr/lib/fieldlogger/msgspec/*.so | grep -o 'GLIBC_[0-9.]*' | sort -Vu | tail -1)
    libraries="libc6 (>= ${glibc#GLIBC_})"
    [ "$1" != armhf ] || libraries="$libraries, libgcc-s1"
    size=$(du -k --apparent-size -s "$root/usr" | cut -f1)
    sed -e "s/@ARCH@/$1/; s/@VERSION@/$version/; s/@LIBRARIES@/$libraries/; s/@SIZE@/$size/" \
        -e "s/@PYTHONS@/$(pythons_for "$1")/" "$here/control" \
        >"$root/DEBIAN/control"
    for script in preinst postinst prerm postrm; do install -m 755 "$here/$script" "$root/DEBIAN"; done
    (cd "$root" && find usr -type f -print0 | sort -z | xargs -0 md5sum) >"$root/DEBIAN/md5sums"
}

# each ARCH... : this script for each; at the end which of them failed, with the first error of each, or its last line
each() {
    version
    export VERSION="$version"
    log=$(mktemp) failed=''
    for arch; do
        if ! "$here/build.sh" "$arch" 2>"$log"; then
            why=$(grep -m1 -E '^(E|ERROR): |error: |not found' "$log" || tail -1 "$log")
            failed="$failed$(printf '\n%s: %s' "$arch" "$why")"
        fi
        cat "$log" >&2
    done
    rm -f "$log"
    [ -z "$failed" ] || { printf 'make deb: not built:%s\n' "$failed" >&2; exit 1; }
}

command -v dpkg-deb >/dev/null || { echo "make deb: Debian or a system made of it is needed" >&2; exit 1; }
if [ $# -gt 1 ]; then
    each "$@"
    exit
fi
arch=$1
# what an earlier call has built is not taken for the result of this one
rm -f "$dist"/fieldlogger_*_"$arch".deb
tools "$arch"
mkdir -p "$cache" "$dist"
if [ ! -e "$cache/venv/ready" ]; then
    python3 -m venv "$cache/venv"
    # the oldest click that the logger allows, so that the completion is one that every release understands
    "$cache/venv/bin/pip" install --quiet --disable-pip-version-check 'click==8.1.*' 'click-man==0.6.*'
    touch "$cache/venv/ready"
fi
version
root=$(mktemp -d)
trap 'rm -rf "$root"' EXIT
program "$arch"
system_files
documentation
chmod -R u=rwX,go=rX "$root"
control "$arch"
dpkg-deb --root-owner-group -Zxz --build "$root" "$dist/fieldlogger_${version}_$arch.deb" >/dev/null
echo "$dist/fieldlogger_${version}_$arch.deb"
