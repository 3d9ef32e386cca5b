"""The LED of systemd/README.md on a real LED class device, that of the board's keyboard."""

import re
import time

import pytest

from logger.sim.scenario import scenario
from tests.boot.machines import BOOT_S, machine, status, wait_recording
from tests.boot.players import carry

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")]

LED = "input0::capslock"
FOLDER = f"/sys/class/leds/{LED}"
SITE = "/etc/cellwalk/site.toml"


@pytest.fixture(scope="module")
def card(installed_card, workplace):
    """A card configured as the page describes it for an additional LED."""
    card = installed_card.copy(workplace / "led.raw")
    tree = workplace / "led-tree"
    drop_in = tree / "etc/systemd/system/fieldlogger.service.d"
    drop_in.mkdir(parents=True)
    (drop_in / "override.conf").write_text(f"[Service]\nReadWritePaths=-{FOLDER}\n")
    (tree / "etc/cellwalk").mkdir()
    site = card.pull(SITE, tree / "etc/cellwalk")
    text, found = re.subn(r"(?m)^# led = \"\"", f'led = "{LED}"', site.read_text())
    site.write_text(text if found else f'{text}\n[status]\nled = "{LED}"\n')
    card.push(tree)
    return card


def _lit(m, samples=400):
    """Fraction of the time in which the LED is on."""
    seen = m.run(
        f"for i in $(seq {samples}); do read b < {FOLDER}/brightness; printf %s $b; sleep 0.02; "
        "done",
        timeout=90,
    )
    return seen.count("1") / samples


def _trigger(m):
    return re.search(r"\[(.+?)\]", m.run(f"cat {FOLDER}/trigger"))[1]


def test_it_tells_recording_and_no_fix_and_goes_back_to_the_kernel(card, workplace):
    with machine(card, workplace / "led") as m, carry(m, scenario()):
        m.boot(BOOT_S)
        if m.run(f"test -e {FOLDER} || echo none", check=False):
            pytest.skip("this board has no keyboard with a light")
        wait_recording(m, more_fixes=5)
        assert _trigger(m) == "none"
        recording = _lit(m)
        m.unplug("gps")
        until_s = time.monotonic() + 60.0
        while status(m).get("state") == "recording":
            assert time.monotonic() < until_s
            time.sleep(1.0)
        without = _lit(m)
        m.run("systemctl stop fieldlogger", timeout=90)
        assert _trigger(m) == "kbd-capslock"
        m.poweroff(BOOT_S)
    print(f"lit for {recording:.0%} of the time while it records, {without:.0%} without a position")
    assert 0.0 < recording < 0.2
    assert 0.35 < without < 0.65
