#!/bin/sh
# msgspec.sh CACHE ARCH TARGET: puts msgspec into the folder TARGET, compiled for ARCH and the Python of each release.
# Debian 12 has no msgspec, and PyPI no wheel of it for armhf. The headers of the foreign Python come from Debian's
# packages, which are unpacked below CACHE and not installed.
set -eu
here=$(dirname "$(readlink -f "$0")")
. "$here/suites.sh"
cache=$1 arch=$2 target=$3
triplet=$(triplet_of "$arch")

source_of_msgspec() {
    [ -d "$cache/msgspec" ] && return
    mkdir -p "$cache/sdist"
    "$cache/venv/bin/pip" download --quiet --disable-pip-version-check --require-hashes --no-deps \
        --no-binary=:all: -d "$cache/sdist" -r "$here/msgspec.txt"
    mkdir "$cache/msgspec.part"
    tar -xzf "$cache"/sdist/msgspec-*.tar.gz -C "$cache/msgspec.part" --strip-components=1
    mv "$cache/msgspec.part" "$cache/msgspec"
}

# headers SUITE: folder with usr/include of Python for ARCH
headers() {
    folder=$cache/headers/$1-$arch
    if [ ! -d "$folder" ]; then
        package=libpython$(python_of "$1")-dev
        mkdir -p "$cache/debs/$1-$arch" "$cache/headers"
        (cd "$cache/debs/$1-$arch" && apt_of "$cache/apt" "$1" "$arch" -qq download "$package" >&2)
        rm -rf "$folder.part"
        dpkg-deb --extract "$cache/debs/$1-$arch/${package}"_*.deb "$folder.part"
        mv "$folder.part" "$folder"
    fi
    echo "$folder"
}

# compile SUITE FOLDER
compile() {
    python=$(python_of "$1")
    include=$(headers "$1")/usr/include
    output=$2/_core.cpython-$(echo "$python" | tr -d .)-$triplet.so
    set -- -shared -fPIC -O2 -DNDEBUG -fwrapv -fno-strict-aliasing -g0 -s -fstack-protector-strong \
        -U_FORTIFY_SOURCE -D_FORTIFY_SOURCE=2 -Wl,-z,relro,-z,now
    # Raspberry Pi OS of 32 bits runs on the Pi Zero and 1 too, which are ARMv6. Debian's compiler means ARMv7, and so
    # do its start files and its static libgcc: neither is linked.
    [ "$arch" != armhf ] || set -- "$@" -march=armv6 -mfpu=vfp -mfloat-abi=hard -marm -nostartfiles -shared-libgcc
    "$triplet-gcc" "$@" -I"$include/python$python" -I"$include" "$cache/msgspec/src/msgspec/_core.c" -lm -o "$output"
}

version=$(sed -n 's/^msgspec==\([^ ]*\).*/\1/p' "$here/msgspec.txt")
built=$cache/msgspec-$version-$arch
if [ ! -d "$built" ]; then
    source_of_msgspec
    rm -rf "$built.part"
    mkdir -p "$built.part/msgspec" "$built.part/msgspec-$version.dist-info"
    cp "$cache"/msgspec/src/msgspec/*.py "$built.part/msgspec"
    cp "$cache/msgspec/PKG-INFO" "$built.part/msgspec-$version.dist-info/METADATA"
    for suite in $suites; do compile "$suite" "$built.part/msgspec"; done
    mv "$built.part" "$built"
fi
cp -r "$built/." "$target"
