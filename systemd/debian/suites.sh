# Read by the other scripts: the releases that one package serves, and an apt of its own to fetch from Debian's.
# The machine's own apt is neither used nor changed.
# shellcheck shell=sh disable=SC2034  # the readers use what is set here
suites="bookworm trixie"
mirror=${DEBIAN_MIRROR:-http://deb.debian.org/debian}
keyring=/usr/share/keyrings/debian-archive-keyring.gpg

python_of() { case $1 in bookworm) echo 3.11 ;; trixie) echo 3.13 ;; esac; }

triplet_of() {
    case $1 in
        amd64) echo x86_64-linux-gnu ;;
        arm64) echo aarch64-linux-gnu ;;
        armhf) echo arm-linux-gnueabihf ;;
        *) echo "no packages are built for $1: amd64, arm64 or armhf" >&2; return 1 ;;
    esac
}

# machine_of ARCH: as PyPI's wheels of msgspec name it; nothing where PyPI has none
machine_of() { case $1 in amd64) echo x86_64 ;; arm64) echo aarch64 ;; esac; }

# of PyPI's wheels: those of Debian, and Ubuntu 24.04's between them
pythons="3.11 3.12 3.13"

# pythons_for ARCH: on which a package depends
pythons_for() {
    if [ -n "$(machine_of "$1")" ]; then
        echo "python3 (>= 3.11~), python3 (<< 3.14)"
    else
        echo "python3 (>= 3.11~), python3 (<< 3.12) | python3 (>= 3.13~), python3 (<< 3.14)"
    fi
}

# apt_of STATE SUITE ARCH COMMAND...: apt-get with sources, lists and installed packages (none) below STATE
apt_of() {
    state=$1/$2-$3 suite=$2 arch=$3
    shift 3
    # lists older than a day may name packages that are gone
    if [ -z "$(find "$state/updated" -mtime -1 2>/dev/null)" ]; then
        mkdir -p "$state/lists/partial" "$state/cache/archives/partial" "$state/parts"
        : >"$state/status"
        echo "deb [signed-by=$keyring] $mirror $suite main" >"$state/sources.list"
        _apt update -qq
        touch "$state/updated"
    fi
    _apt "$@"
}

_apt() {
    apt-get -o "Dir::State=$state" -o "Dir::State::status=$state/status" -o "Dir::State::lists=$state/lists" \
        -o "Dir::Cache=$state/cache" -o "Dir::Etc::SourceList=$state/sources.list" \
        -o "Dir::Etc::SourceParts=$state/parts" -o "Dir::Etc::PreferencesParts=$state/parts" \
        -o "APT::Architecture=$arch" -o "APT::Architectures=$arch" \
        -o APT::Sandbox::User=root -o Acquire::Languages=none -o Acquire::Retries=3 "$@"
}
