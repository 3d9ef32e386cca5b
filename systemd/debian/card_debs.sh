#!/bin/sh
# card_debs.sh FOLDER ARCH SUITE: FOLDER gets the logger's package and all that it needs of a Debian release, as a
# source that apt can install from without a network. `make card-debs` calls it.
# overlayroot is there for prepare-card.sh --overlay. The folder has everything down to the C library: apt on the Pi
# takes only what is missing there.
set -eu
here=$(dirname "$(readlink -f "$0")")
repository=$(readlink -f "$here/../..")
. "$here/suites.sh"
folder=$1 arch=$2 suite=$3
cache=$repository/.venv/deb
case " $suites " in
    *" $suite "*) ;;
    *) echo "make card-debs: SUITE is one of $suites" >&2; exit 1 ;;
esac
package=$("$here/build.sh" "$arch" | tail -1)
[ -f "$package" ]

archives=$cache/archives-$suite-$arch
mkdir -p "$folder" "$archives/partial"
apt_here() { apt_of "$cache/apt" "$suite" "$arch" -qq -y -o "Dir::Cache::Archives=$archives" "$@"; }
apt_here autoclean
apt_here --no-install-recommends --download-only install "$package" overlayroot
rm -f "$folder"/*.deb "$folder"/Packages
# apt would read the %3a of an epoch in a name as a colon
for deb in "$archives"/*.deb "$package"; do
    cp "$deb" "$folder/$(basename "$deb" | sed 's/_[0-9]*%3a/_/')"
done
(cd "$folder" && dpkg-scanpackages --multiversion . 2>/dev/null >Packages)
echo "$suite $arch" >"$folder/made-for"
du -sh "$folder"
