#!/bin/sh
# prepare-card.sh BOOTFS --debs DIR [option]...
# Prepares a card with a freshly written Raspberry Pi OS: its first boot installs the logger without a network, and the
# next one records. BOOTFS is the folder where the card's boot partition (bootfs) is mounted.
#
#   --debs DIR        the packages, made by `make card-debs`, of the same release and architecture as the card
#   --hostname NAME   name of the Pi (default cellwalk)
#   --user NAME       a user who may use sudo and read the runs; the password is asked for
#   --ssh-key FILE    public key of this user, which also switches ssh on
#   --hotspot SSID    the Pi makes a Wi-Fi with the page for the phone; a password is made and printed
#   --country CC      country of the Wi-Fi, two letters; a hotspot needs it
#   --site FILE       site.toml; without it the first boot looks for modem and receiver
#   --overlay         root in memory, if a partition with the label cellwalk is there for the runs
set -eu
here=$(dirname "$(readlink -f "$0")")
bootfs='' debs='' hostname=cellwalk user='' key='' hotspot='' country='' site='' overlay=''

usage() { sed -n 's/^# \{0,1\}//; 2,13p' "$0"; }
say() { printf '%s\n' "prepare-card.sh: $*"; }
fail() { say "$*" >&2; exit 1; }

while [ $# -gt 0 ]; do
    case $1 in
        --debs | --hostname | --user | --ssh-key | --hotspot | --country | --site)
            [ $# -ge 2 ] || fail "$1 needs a value"
            case $1 in
                --debs) debs=$2 ;;
                --hostname) hostname=$2 ;;
                --user) user=$2 ;;
                --ssh-key) key=$2 ;;
                --hotspot) hotspot=$2 ;;
                --country) country=$2 ;;
                --site) site=$2 ;;
            esac
            shift ;;
        --overlay) overlay=yes ;;
        -h | --help) usage; exit 0 ;;
        -*) usage >&2; exit 2 ;;
        *) [ -z "$bootfs" ] || fail "one folder only: $bootfs or $1"
           bootfs=$1 ;;
    esac
    shift
done

matches() { printf '%s' "$1" | LC_ALL=C grep -qxE "$2"; }

# everything is checked before anything is written
[ -n "$bootfs" ] || { usage >&2; exit 2; }
[ -f "$bootfs/cmdline.txt" ] || fail "$bootfs is no boot partition of Raspberry Pi OS: it has no cmdline.txt"
[ -w "$bootfs/cmdline.txt" ] || fail "$bootfs cannot be written: sudo, or mount it writable"
[ -n "$debs" ] || fail "--debs is needed: make card-debs fills such a folder"
[ -e "$debs/made-for" ] || fail "$debs has no packages: make card-debs fills such a folder"
matches "$hostname" '[A-Za-z0-9]([A-Za-z0-9-]{0,61}[A-Za-z0-9])?' || fail "no host name: $hostname"
[ -z "$user" ] || matches "$user" '[a-z_][a-z0-9_-]{0,30}' || fail "no user name: $user"
[ -z "$key" ] || [ -n "$user" ] || fail "--ssh-key needs --user"
[ -z "$key" ] || grep -qE '^(ssh|ecdsa|sk)-' "$key" || fail "$key has no public key"
[ -z "$country" ] || matches "$country" '[A-Z]{2}' || fail "a country has two capital letters: $country"
[ -z "$hotspot" ] || [ -n "$country" ] || fail "--hotspot needs --country"
[ -z "$hotspot" ] || matches "$hotspot" '[A-Za-z0-9 ._-]{1,32}' ||
    fail "no name of a Wi-Fi (letters, digits, blank, . _ -): $hotspot"
[ -z "$site" ] || [ -f "$site" ] || fail "no such file: $site"
for name in firstrun.sh cellwalk; do
    [ ! -e "$bootfs/$name" ] || fail "$bootfs has $name already: write the card anew, without settings of the Imager"
done
if [ -e "$bootfs/user-data" ] && grep -qvE '^ *(#|$)' "$bootfs/user-data"; then
    fail "$bootfs/user-data has settings already: write the card anew, without settings of the Imager"
fi
needed_kb=$(du -sk "$debs" | cut -f1) free_kb=$(df -Pk "$bootfs" | awk 'END { print $4 }')
[ "$free_kb" -gt $((needed_kb + 4096)) ] ||
    fail "$bootfs has $((free_kb / 1024)) MB left; $debs needs $((needed_kb / 1024 + 4))"

password_hash=''
if [ -n "$user" ]; then
    command -v openssl >/dev/null || fail "openssl is needed for the password: apt-get install openssl"
    if [ -t 0 ]; then
        stty -echo
        printf 'Password of %s: ' "$user" >&2
    fi
    IFS= read -r password || true
    if [ -t 0 ]; then stty echo; echo >&2; fi
    [ -n "$password" ] || fail "no password was given"
    password_hash=$(printf '%s\n' "$password" | openssl passwd -6 -stdin)
fi
hotspot_password=''
if [ -n "$hotspot" ]; then
    # without letters and digits that look alike
    hotspot_password=$(LC_ALL=C tr -dc 'a-km-z2-9' </dev/urandom | head -c 16)
fi

settings() {
    cat <<END
hostname='$hostname'
user='$user'
password_hash='$password_hash'
hotspot='$hotspot'
hotspot_password='$hotspot_password'
overlay='$overlay'
END
}

folder=$bootfs/cellwalk
mkdir "$folder" "$folder/debs"
cp "$here/card/first-boot.sh" "$here/install.sh" "$folder"
cp "$debs"/*.deb "$debs/Packages" "$debs/made-for" "$folder/debs"
[ -z "$key" ] || cp "$key" "$folder/authorized_keys"
[ -z "$site" ] || cp "$site" "$folder/site.toml"
settings >"$folder/settings"
if [ -n "$country" ]; then
    sed -i "1 s/ cfg80211\.ieee80211_regdom=[^ ]*//g; 1 s/\$/ cfg80211.ieee80211_regdom=$country/" "$bootfs/cmdline.txt"
fi

# The start of the first boot is written last: a card that is pulled out before is as it was.
if [ -e "$bootfs/user-data" ] || [ -e "$bootfs/meta-data" ]; then
    # Raspberry Pi OS of Debian 13: cloud-init reads the boot partition
    [ -e "$bootfs/meta-data" ] || echo 'instance-id: cellwalk' >"$bootfs/meta-data"
    cat >"$bootfs/user-data" <<END
#cloud-config
users: []
runcmd:
  - [sh, /boot/firmware/cellwalk/first-boot.sh]
power_state:
  mode: reboot
END
else
    # of Debian 12: systemd runs one command instead of the usual services, and restarts
    printf '#!/bin/sh\nexec sh /boot/firmware/cellwalk/first-boot.sh\n' >"$bootfs/firstrun.sh"
    command="systemd.run=/boot/firmware/firstrun.sh systemd.run_success_action=reboot"
    command="$command systemd.run_failure_action=reboot systemd.unit=kernel-command-line.target"
    sed -i "1 s|\$| $command|" "$bootfs/cmdline.txt"
fi
sync
say "done: unmount the card, put it into the Pi, plug in modem and receiver, and power it"
say "it restarts once or twice and then records; cellwalk/log on the boot partition says what was done"
[ -z "$hotspot" ] || say "Wi-Fi $hotspot, password $hotspot_password (write it down)"
