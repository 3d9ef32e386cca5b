"""From a freshly written card to the first recorded byte, without a network, by prepare-card.sh.

Raspberry Pi OS is not to be had here. Its two mechanisms are followed on Debian, which has them
too: systemd.run= in cmdline.txt (Raspberry Pi OS of Debian 12), and cloud-init's data on the boot
partition (of Debian 13). What only Raspberry Pi OS has is not followed: its firmware, the growing
of its root, its questions at the first boot, the driver of its Wi-Fi.
"""

import shutil
import subprocess
import time
from dataclasses import dataclass, field

import pytest

from logger.core.runfile import read_run
from logger.sim.scenario import scenario
from tests.boot.machines import (
    BOOT_S,
    PACKAGES,
    REPOSITORY,
    RUNS,
    build_image,
    build_packages,
    machine,
    rig,
    status,
    wait_recording,
)
from tests.boot.overlay import kernel_with_overlay
from tests.boot.partitions import partition, with_boot_partition
from tests.boot.players import carry

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")]

PREPARE = REPOSITORY / "systemd/prepare-card.sh"
PASSWORD = "a password of the test"
LIBRARIES = "python3-numpy python3-h5py python3-h5py-serial python3-pyproj python3-nmea2"
"""What the rig's image has, and Raspberry Pi OS Lite does not; cloud-init needs python3-serial."""
IMAGES = {"firstrun": PACKAGES, "cloud-init": "apt,cloud-init", "overlay": PACKAGES}
"""Debian packages of the image with each mechanism; `overlay` is `firstrun` with a root in memory.
"""
RUNS_MIB = 256
_FIRSTRUN = {"cmdline.txt": "rootwait quiet\n", "config.txt": "# as delivered\n"}
FILES = {
    "firstrun": _FIRSTRUN,
    "overlay": _FIRSTRUN,
    "cloud-init": {
        "cmdline.txt": "rootwait quiet\n",
        "config.txt": "# as delivered\n",
        "user-data": "#cloud-config\n# nothing yet\n",
        "meta-data": "instance-id: rpios-image\n",
    },
}


@dataclass
class Story:
    """What was seen; times in seconds since the card was first powered."""

    style: str
    steps: list[tuple[float, str]] = field(default_factory=list)
    log: str = ""
    names: set[str] = field(default_factory=set)
    arguments: str = ""
    seen: dict[str, str] = field(default_factory=dict)
    fixes: int = 0


DATASOURCE = "datasource_list: [NoCloud, None]\\ndatasource: {NoCloud: {fs_label: bootfs}}\\n"
"""Raspberry Pi OS names the mounted folder (seedfrom), for which its cloud-init waits."""


def _pristine(folder, image):
    """A card as Raspberry Pi OS is: the libraries of the logger are not on it."""
    card = rig.Card(folder / "root.raw", image)
    with machine(card, folder / "before", kernel=image.parent) as m:
        m.boot(BOOT_S, append="cloud-init=disabled")
        m.run(f"dpkg --purge --force-depends {LIBRARIES}", timeout=300)
        m.run("mkdir -p /boot/firmware /etc/cloud/cloud.cfg.d")
        m.run(f"printf '{DATASOURCE}' > /etc/cloud/cloud.cfg.d/99_bootfs.cfg")
        m.run("echo 'LABEL=bootfs /boot/firmware vfat defaults 0 0' >> /etc/fstab")
        m.poweroff(BOOT_S)
    return card


def _prepare_card(boot, folder, style, debs):
    """Write the boot partition as delivered, and prepare it as a user would."""
    reader = folder / "bootfs"
    reader.mkdir()
    for name, text in FILES[style].items():
        (reader / name).write_text(text)
    options = ["--hostname", "walker", "--user", "ada", "--country", "DE", "--hotspot", "walk"]
    options += ["--overlay"] if style == "overlay" else []
    done = subprocess.run(
        ["sh", PREPARE, reader, "--debs", debs, *options],
        input=f"{PASSWORD}\n", capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    print(done.stdout)
    boot.write(reader)


def _first_boots(m, boot, story):
    """Power on until the machine has restarted by itself and records."""
    powered_s = time.monotonic()

    def at(what):
        story.steps.append((time.monotonic() - powered_s, what))

    root = f"root={partition(2)}"
    m.boot(wait=False, append=f"{root} {boot.arguments()}")
    at("power on")
    m.proc.wait(3 * BOOT_S)
    at("installed; it restarts")
    m.cut_power("issued")
    story.log = boot.read("cellwalk/log")
    print(story.log)
    story.names, story.arguments = boot.names(), boot.arguments()
    m.boot(BOOT_S, append=f"{root} {boot.arguments()}")
    at("second boot done")
    wait_recording(m, more_fixes=1)
    at("it records positions")


@pytest.fixture(scope="module", params=list(IMAGES))
def story(request, workplace):
    style = request.param
    for tool in ("mcopy", "mkfs.vfat", "openssl"):
        if shutil.which(tool) is None:
            pytest.skip(f"no {tool} here")
    image, debs = build_image(IMAGES[style]), build_packages()
    folder = workplace / style
    folder.mkdir()
    card, root = rig.Card(folder / "card.raw"), _pristine(folder, image)
    is_overlaid = style == "overlay"
    kernel = kernel_with_overlay(root, folder) if is_overlaid else image.parent
    boot = with_boot_partition(root.path, card.path, RUNS_MIB if is_overlaid else 0)
    _prepare_card(boot, folder, style, debs)
    seen = Story(style)
    with machine(card, folder / "machine", kernel=kernel) as m, carry(m, scenario()):
        _first_boots(m, boot, seen)
        for command in (
            "cat /etc/hostname",
            "date +%Z",
            "id -nG ada",
            "getent shadow ada | cut -d: -f2",
            "stat -c %a /etc/NetworkManager/system-connections/cellwalk.nmconnection",
            "grep ^listen /etc/cellwalk/site.toml",
            "systemctl is-enabled fieldlogger",
            "ls /sys/class/net",
            f"stat -fc %T / {RUNS}",
        ):
            seen.seen[command] = m.run(command, check=False)
        seen.fixes = status(m)["fixes"]
        m.run("systemctl stop fieldlogger && mkdir /boot/firmware/runs", timeout=120)
        m.run("cp /var/lib/cellwalk/*.h5 /boot/firmware/runs/")
        m.poweroff(BOOT_S)
    for at_s, what in seen.steps:
        print(f"{style}: {at_s / 60:5.1f} min  {what}")
    runs = folder / "runs"
    runs.mkdir()
    for name in sorted(boot.names()):
        if name.startswith("runs/") and name.endswith(".h5"):
            boot.fetch(name, runs)
    return seen, runs


def test_every_step_of_the_first_boot_succeeded(story):
    log = story[0].log
    assert "FAILED" not in log
    for step in ("UTC", "hostname", "installation", "ports", "user", "hotspot", "page", "cleaning"):
        assert f"ok  {step}\n" in log
    assert ("ok  overlay\n" in log) == (story[0].style == "overlay")


def test_the_root_is_in_memory_if_that_was_asked(story):
    on_card = "ext2/ext3"
    root = "overlayfs" if story[0].style == "overlay" else on_card
    assert story[0].seen[f"stat -fc %T / {RUNS}"].split() == [root, on_card]


def test_it_is_not_repeated_and_no_password_stays_on_the_boot_partition(story):
    seen = story[0]
    assert "systemd.run" not in seen.arguments
    assert "cfg80211.ieee80211_regdom=DE" in seen.arguments
    assert "cellwalk/settings" not in seen.names
    assert "firstrun.sh" not in seen.names
    assert not [name for name in seen.names if name.endswith(".deb")]


def test_the_pi_is_as_asked(story):
    seen = story[0].seen
    assert seen["cat /etc/hostname"] == "walker"
    assert seen["date +%Z"] == "UTC"
    assert {"ada", "cellwalk", "dialout"} <= set(seen["id -nG ada"].split())
    salt = seen["getent shadow ada | cut -d: -f2"].split("$")[2]
    hashed = subprocess.run(
        ["openssl", "passwd", "-6", "-salt", salt, PASSWORD],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert seen["getent shadow ada | cut -d: -f2"] == hashed.stdout.strip()
    assert seen["grep ^listen /etc/cellwalk/site.toml"] == 'listen = "10.42.0.1:8080"'
    assert seen["systemctl is-enabled fieldlogger"] == "enabled"
    mode = "stat -c %a /etc/NetworkManager/system-connections/cellwalk.nmconnection"
    assert seen[mode] == "600"
    assert seen["ls /sys/class/net"] == "lo"  # it has never had a network


def test_the_walk_is_recorded(story):
    seen, runs = story
    (run,) = (read_run(path) for path in sorted(runs.glob("run-*.h5"))[-1:])
    assert set(run.tables["raw"]["source"]) == {b"modem", b"gnss"}
    assert len(run.tables["fixes"]) >= seen.fixes > 0
    assert run.end is not None
