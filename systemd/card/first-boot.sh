#!/bin/sh
# The first boot of a card that prepare-card.sh has prepared; it lies in the folder cellwalk of the boot partition.
# Installs the logger from the packages beside it, without a network, and sets what `settings` says. Each step is
# written to `log`; one that fails does not stop the others, since a Pi without a screen must come up.
# shellcheck disable=SC2317  # the functions are called by name, in step
here=$(dirname "$(readlink -f "$0")")
boot=$(dirname "$here")
exec >>"$here/log" 2>&1

# step NAME COMMAND...
step() {
    name=$1
    shift
    echo "== $name"
    (set -e; "$@")
    # shellcheck disable=SC2181  # an `if` around the command would switch -e off in it
    if [ $? -eq 0 ]; then echo "ok  $name"; else echo "FAILED  $name"; fi
}

# the clock of the machine runs in UTC; the time comes from the receiver
utc() {
    if [ -e /usr/share/zoneinfo/Etc/UTC ]; then
        ln -sfn /usr/share/zoneinfo/Etc/UTC /etc/localtime
    else
        rm -f /etc/localtime
    fi
    echo Etc/UTC >/etc/timezone
}

hostname_of_pi() {
    before=$(cat /etc/hostname 2>/dev/null || echo localhost)
    echo "$hostname" >/etc/hostname
    if grep -q "^127\.0\.1\.1" /etc/hosts 2>/dev/null; then
        sed -i "s/^127\.0\.1\.1.*/127.0.1.1\t$hostname/" /etc/hosts
    else
        printf '127.0.1.1\t%s\n' "$hostname" >>/etc/hosts
    fi
    hostname "$hostname"
    echo "$before is now $hostname"
}

# Raspberry Pi OS renames its first user by a program of its own, which also ends the questions of the first boot
user_of_pi() {
    if [ -x /usr/lib/userconf-pi/userconf ]; then
        /usr/lib/userconf-pi/userconf "$user" "$password_hash"
    else
        getent passwd "$user" >/dev/null || useradd --create-home --shell /bin/bash "$user"
        echo "$user:$password_hash" | chpasswd --encrypted
        if getent group sudo >/dev/null; then usermod -aG sudo "$user"; fi
    fi
    for group in cellwalk dialout; do
        if getent group "$group" >/dev/null; then usermod -aG "$group" "$user"; fi
    done
}

ssh_key_of_user() {
    home=$(getent passwd "$user" | cut -d: -f6)
    install -d -m 700 -o "$user" -g "$user" "$home/.ssh"
    install -m 600 -o "$user" -g "$user" "$here/authorized_keys" "$home/.ssh/authorized_keys"
    systemctl enable ssh.service
}

wifi_on() {
    # Raspberry Pi OS keeps the radio off until a country is set; cmdline.txt names it
    rfkill unblock wifi || true
    for file in /var/lib/systemd/rfkill/*:wlan; do
        if [ -e "$file" ]; then echo 0 >"$file"; fi
    done
}

hotspot_of_pi() {
    folder=/etc/NetworkManager/system-connections
    mkdir -p "$folder"
    (
        umask 077
        cat >"$folder/cellwalk.nmconnection" <<EOF
[connection]
id=cellwalk
type=wifi
interface-name=wlan0
autoconnect=true
autoconnect-priority=100

[wifi]
mode=ap
ssid=$hotspot

[wifi-security]
key-mgmt=wpa-psk
proto=rsn;
pairwise=ccmp;
psk=$hotspot_password

[ipv4]
method=shared
address1=10.42.0.1/24

[ipv6]
method=disabled
EOF
    )
}

# the ports that answer now; what is not plugged in keeps the names of the sample
ports() {
    site=/etc/cellwalk/site.toml
    if [ -e "$here/site.toml" ]; then
        cp "$here/site.toml" "$site"
    else
        systemctl stop fieldlogger.service
        rm -f /run/cellwalk-site.toml
        if fieldlogger probe --write /run/cellwalk-site.toml; then
            cp /run/cellwalk-site.toml "$site"
        else
            echo "not both devices have answered: the ports are those of the sample"
        fi
    fi
    fieldlogger check --config "$site"
}

page_in_hotspot() {
    site=/etc/cellwalk/site.toml
    if grep -q '^\[page\]' "$site"; then
        sed -i '/^\[page\]/,/^\[/ s/^\(# \)\{0,1\}listen = .*/listen = "10.42.0.1:8080"/' "$site"
    else
        printf '\n[page]\nlisten = "10.42.0.1:8080"\n' >>"$site"
    fi
    grep -q '^listen = "10.42.0.1:8080"' "$site"
}

# Only with a partition for the runs, which a root in memory would lose: README.md, Read-only root
overlay_of_root() {
    if ! device=$(blkid -L cellwalk); then
        echo "no ext4 partition with the label cellwalk: the root stays writable"
        return 1
    fi
    sh "$here/install.sh" "$here/debs" overlayroot
    grep -q '/var/lib/cellwalk ' /etc/fstab ||
        echo 'LABEL=cellwalk /var/lib/cellwalk ext4 noatime,nofail 0 2' >>/etc/fstab
    mkdir -p /etc/systemd/journald.conf.d
    printf '[Journal]\nStorage=volatile\n' >/etc/systemd/journald.conf.d/cellwalk.conf
    sed -i '1 s/$/ fsck.repair=yes overlayroot=tmpfs:recurse=0/' "$boot/cmdline.txt"
    echo "runs on $device"
}

installation() {
    # after a power cut during the first try
    dpkg --configure -a
    sh "$here/install.sh" "$here/debs"
}

# nothing of this is needed any more, and settings has passwords
cleaning() {
    sed -i 's/ systemd\.[^ ]*//g' "$boot/cmdline.txt"
    rm -f "$boot/firstrun.sh" "$here/settings" "$here/authorized_keys"
    if command -v fieldlogger >/dev/null; then rm -rf "$here/debs"; fi
    # cloud-init would find its commands again
    if [ -e "$boot/user-data" ]; then echo '#cloud-config' >"$boot/user-data"; fi
    sync
}

main() {
    hostname='' user='' password_hash='' hotspot='' hotspot_password='' overlay=''
    # shellcheck source=/dev/null
    . "$here/settings"
    echo "cellwalk: first boot, $(cut -d' ' -f1 /proc/uptime) s after power-on"
    step UTC utc
    [ -z "$hostname" ] || step hostname hostname_of_pi
    step installation installation
    step ports ports
    [ -z "$user" ] || step user user_of_pi
    [ ! -e "$here/authorized_keys" ] || step ssh ssh_key_of_user
    if [ -n "$hotspot" ]; then
        step Wi-Fi wifi_on
        step hotspot hotspot_of_pi
        step page page_in_hotspot
    fi
    [ -z "$overlay" ] || step overlay overlay_of_root
    step cleaning cleaning
    echo "cellwalk: done, $(cut -d' ' -f1 /proc/uptime) s after power-on"
}

main
sync
exit 0 # the mechanisms of the first boot then restart
