"""A network card for a machine of the boot rig, as if it were the Pi's own Wi-Fi."""

import subprocess
from http.client import HTTPConnection
from pathlib import Path

import pytest

from tests.boot.machines import BOARD, image_folder, rig

PI = "10.42.0.1"
"""The Pi in the network of NetworkManager's hotspot, which the unit of the page allows."""
PHONE = "10.42.0.2"
"""Where the connections of this machine seem to come from."""
PAGE_PORT = 8080
DRIVERS = ("net/core/failover.ko", "drivers/net/net_failover.ko", "drivers/net/virtio_net.ko")
"""Modules of the kernel that the image of the rig lacks, each after those that it needs."""


def fetch_drivers(folder: Path) -> None:
    """Put the drivers of the image's kernel into a folder; skips where its package is not there."""
    arch = rig.BOARDS[BOARD]["arch"]
    installed = (image_folder() / f"packages-{arch}.txt").read_text().split()
    (package,) = (name for name in installed if name.startswith("linux-image-6"))
    done = subprocess.run(
        ["apt-get", "download", f"{package}:{arch}"],
        cwd=folder, capture_output=True, text=True, check=False,
    )  # fmt: skip
    if done.returncode:
        pytest.skip(f"{package} cannot be downloaded: {done.stderr.strip()[-200:]}")
    (archive,) = folder.glob("linux-image-*.deb")
    content = subprocess.run(
        ["dpkg-deb", "--fsys-tarfile", archive], check=True, capture_output=True
    ).stdout
    wanted = [f"*/kernel/{driver}" for driver in DRIVERS]
    subprocess.run(
        ["tar", "-x", "--wildcards", "--transform", "s|.*/||", *wanted],
        cwd=folder, input=content, check=True,
    )  # fmt: skip
    archive.unlink()


def add_card(m, port: int) -> None:
    """Give a machine that is off a network card; a port of this machine leads to its page.

    No other connection leaves or enters (`restrict`).
    """
    network = f"user,id=hotspot,restrict=on,net=10.42.0.0/24,host={PHONE}"
    forward = f"hostfwd=tcp:127.0.0.1:{port}-{PI}:{PAGE_PORT}"
    m.board = m.board | {
        "qemu": [*m.board["qemu"], "-netdev", f"{network},{forward}"],
        "devices": [*m.board["devices"], "virtio-net-pci,netdev=hotspot"],
    }


def bring_up(m) -> None:
    """Load the drivers in a machine that runs, and give it the address of a hotspot."""
    for driver in DRIVERS:
        m.run(f"insmod /mnt/host/{Path(driver).name} 2>/dev/null || true")
    m.run("until ls /sys/class/net | grep -qv '^lo$'; do sleep 0.5; done", timeout=60)
    name = m.run("ls /sys/class/net | grep -v '^lo$'")
    m.run(f"busybox ifconfig {name} {PI} netmask 255.255.255.0 up")


def ask(port: int, path: str, body: bytes | None = None, host: str = f"{PI}:{PAGE_PORT}"):
    """Status and content of the answer to a phone; OSError where there is none."""
    phone = HTTPConnection("127.0.0.1", port, timeout=20)
    headers = {"Host": host, "Origin": f"http://{host}", "Content-Type": "application/json"}
    try:
        phone.request("GET" if body is None else "POST", path, body, headers)
        answer = phone.getresponse()
        return answer.status, answer.read()
    finally:
        phone.close()
