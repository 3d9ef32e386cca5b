#!/bin/sh
# msgspec.sh CACHE ARCH TARGET: puts msgspec into the folder TARGET, for ARCH and each Python that the package serves.
# Debian 12 has no msgspec. For amd64 and arm64 the compiled files are those of PyPI's wheels. PyPI has none for armhf:
# there they are compiled, with the headers of Debian's packages, which are unpacked below CACHE and not installed.
set -eu
here=$(dirname "$(readlink -f "$0")")
. "$here/suites.sh"
cache=$1 arch=$2 target=$3
triplet=$(triplet_of "$arch")

# download FOLDER OPTION...: msgspec of PyPI, where its digest is right
download() {
    mkdir -p "$1"
    "$cache/venv/bin/pip" download --quiet --disable-pip-version-check --require-hashes --no-deps \
        -r "$here/msgspec.txt" -d "$@"
}

# from_wheels FOLDER: they ask for no newer C library than that of 2012
from_wheels() {
    for python in $pythons; do
        wheel=$cache/wheel-$arch-$python
        rm -rf "$wheel"
        download "$wheel" --only-binary=:all: --python-version "$python" --platform "manylinux2014_$(machine_of "$arch")"
        "$cache/venv/bin/python" -m zipfile -e "$wheel"/msgspec-*.whl "$wheel"
        install -m 755 "$wheel"/msgspec/_core.*.so "$1/msgspec"
        install -m 644 "$wheel"/msgspec/*.py "$1/msgspec"
        install -m 644 "$wheel"/msgspec-*.dist-info/METADATA "$1/msgspec-$version.dist-info"
    done
    "$triplet-strip" "$1"/msgspec/*.so
}

# from_source FOLDER
from_source() {
    rm -rf "$cache/sdist"
    download "$cache/sdist" --no-binary=:all:
    tar -xzf "$cache"/sdist/msgspec-*.tar.gz -C "$cache/sdist" --strip-components=1
    cp "$cache"/sdist/src/msgspec/*.py "$1/msgspec"
    cp "$cache/sdist/PKG-INFO" "$1/msgspec-$version.dist-info/METADATA"
    for suite in $suites; do compile "$suite" "$1/msgspec"; done
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
    # Raspberry Pi OS of 32 bits runs on the Pi Zero and 1 too, which are ARMv6. Debian's compiler means ARMv7, and so
    # do its start files and its static libgcc: neither is linked.
    "$triplet-gcc" -shared -fPIC -O2 -DNDEBUG -fwrapv -fno-strict-aliasing -g0 -s -fstack-protector-strong \
        -U_FORTIFY_SOURCE -D_FORTIFY_SOURCE=2 -Wl,-z,relro,-z,now \
        -march=armv6 -mfpu=vfp -mfloat-abi=hard -marm -nostartfiles -shared-libgcc \
        -I"$include/python$python" -I"$include" "$cache/sdist/src/msgspec/_core.c" -lm -o "$output"
}

version=$(sed -n 's/^msgspec==\([^ ]*\).*/\1/p' "$here/msgspec.txt")
# an earlier recipe has left out a Python
recipe=$(cat "$here/msgspec.sh" "$here/suites.sh" | cksum | cut -d' ' -f1)
built=$cache/msgspec-$version-$arch-$recipe
if [ ! -d "$built" ]; then
    rm -rf "$built.part"
    mkdir -p "$built.part/msgspec" "$built.part/msgspec-$version.dist-info"
    if [ -n "$(machine_of "$arch")" ]; then from_wheels "$built.part"; else from_source "$built.part"; fi
    mv "$built.part" "$built"
fi
cp -r "$built/." "$target"
