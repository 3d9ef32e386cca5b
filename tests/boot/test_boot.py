"""Installation, boot, walk, unplugged devices, power cut, boot without a clock, and the runs."""

import json
import os
import re
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from logger.core.runfile import read_run, sealing_of
from logger.core.timebase import fit
from logger.sim.scenario import UTC_START, scenario
from postproc.cli import main as postproc
from tests.boot.machines import BOOT_S, RUNS, boottime_zero_s, machine, wait_recording
from tests.boot.players import carry

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")]

REPLUGS = int(os.environ.get("CELLWALK_REPLUGS", "5"))


@dataclass
class Story:
    """Observations of all boots; times in seconds of the host's clock, or since power-on."""

    walk_begun_s: float = 0.0
    power_on_s: float = 0.0
    zero_s: float = 0.0
    """Host time when CLOCK_BOOTTIME of the first boot was 0."""
    again_zero_s: float = 0.0
    outages: list[tuple[str, float, float]] = field(default_factory=list)
    read_only_s: tuple[float, float] = (0.0, 0.0)
    cut_s: float = 0.0
    restarts: str = ""
    started: dict[str, str] = field(default_factory=dict)
    exposure: float = 10.0
    listening: str = "?"
    sent: dict[str, int] = field(default_factory=dict)
    clock_of_second_boot: str = ""
    runs: Path = Path()


@pytest.fixture(scope="module")
def story(installed_card, workplace):
    seen = Story()
    card = installed_card.copy(workplace / "story.raw")
    with machine(card, workplace / "story") as m, carry(m, scenario()):
        seen.walk_begun_s = seen.power_on_s = time.monotonic()
        m.boot(BOOT_S)
        seen.zero_s = boottime_zero_s(m)
        wait_recording(m, more_fixes=20)
        for i in range(REPLUGS):
            for name in ("modem", "gps"):
                seen.outages.append(_replug(m, name, 2.0 + i % 3))
        seen.read_only_s = _read_only(m)
        wait_recording(m, more_fixes=30)
        _look(m, seen)
        seen.cut_s = time.monotonic()
        m.cut_power()

        m.boot(BOOT_S, rtc="1970-01-01")
        seen.again_zero_s = boottime_zero_s(m)
        seen.clock_of_second_boot = m.run(
            "dmesg | grep -o 'setting system clock to [0-9-]*'; date -uI"
        )
        wait_recording(m, more_fixes=30)
        m.run("until ! systemctl -q is-active fieldlogger-recover; do sleep 1; done", timeout=120)
        m.poweroff(BOOT_S)
    seen.runs = card.pull(RUNS, workplace / "fetched")
    return seen


def _replug(m, name, for_s):
    """Unplug, wait, plug in again, and wait until the logger opens it; the two times."""
    unplugged_s = time.monotonic()
    m.unplug(name)
    time.sleep(for_s)
    m.replug(name)
    replugged_s = time.monotonic()
    source = {"modem": "modem", "gps": "gnss"}[name]
    m.run(
        f"for i in $(seq 60); do grep -A3 '\"{source}\": {{' /run/cellwalk/status.json "
        "| grep -q 'is_open\": true' && exit 0; sleep 0.5; done; exit 1",
        timeout=90,
    )
    time.sleep(3.0)
    return source, unplugged_s, replugged_s


def _read_only(m, for_s=10.0):
    """Make the card read-only, as after an error, and writable again; the two times."""
    begun_s = time.monotonic()
    m.run("echo u > /proc/sysrq-trigger; until ! touch /refused; do sleep 0.1; done")
    time.sleep(for_s)
    m.run("mount -o remount,rw /")
    return begun_s, time.monotonic()


def _look(m, seen):
    seen.restarts = m.run("systemctl show -P NRestarts fieldlogger")
    times = "ExecMainStartTimestampMonotonic,ActiveEnterTimestampMonotonic"
    said = m.run(f"systemctl show --property={times} fieldlogger")
    seen.started = dict(line.split("=", 1) for line in said.split())
    report = m.run("systemd-analyze security --no-pager fieldlogger | tail -1")
    seen.exposure = float(re.search(r"\d+\.\d+", report)[0])
    # no iproute2 in the image: what `ss -lntu` reads; state 0A listens, 07 is any open UDP port
    seen.listening = m.run(
        "cat /proc/net/tcp /proc/net/tcp6 /proc/net/udp /proc/net/udp6 | awk '$4 ~ /^(0A|07)$/'"
    )
    seen.sent = _asked_to_send(m)


def _asked_to_send(m):
    """Packets that any program of the machine gave to the kernel, with or without a route."""
    names, values = (line.split()[1:] for line in m.run("grep ^Ip: /proc/net/snmp").splitlines())
    four = dict(zip(names, map(int, values), strict=True))
    six = dict(
        line.split()
        for line in m.run("cat /proc/net/snmp6", check=False).splitlines()
        if "No such" not in line
    )
    return {
        "IPv4": four["OutRequests"] + four["OutNoRoutes"],
        "IPv6": int(six.get("Ip6OutRequests", 0)) + int(six.get("Ip6OutNoRoutes", 0)),
    }


def _run(story, number):
    return read_run(story.runs / f"run-{number:06d}.h5")


def test_it_records_from_power_on(story):
    raw = _run(story, 1).tables["raw"]
    first_s = story.zero_s + raw["t_ns"].min() / 1e9 - story.power_on_s
    kernel_s = raw["t_ns"].min() / 1e9
    print(
        f"power on to first recorded byte: {first_s:.1f} s ({kernel_s:.1f} s since the kernel "
        f"began)"
    )
    begun_us, durable_us = (
        int(story.started[f"{name}TimestampMonotonic"]) for name in ("ExecMainStart", "ActiveEnter")
    )
    print(
        f"process start to the first durable bytes, as systemd was told: "
        f"{(durable_us - begun_us) / 1e6:.2f} s"
    )
    assert set(raw["source"]) == {b"modem", b"gnss"}
    assert first_s < BOOT_S


def test_the_service_is_shut_in_and_nothing_leaves_the_machine(story):
    print(
        f"exposure {story.exposure}; listening: {story.listening or 'nothing'}; packets asked "
        f"for: {story.sent}"
    )
    assert story.exposure <= 1.5
    assert story.listening == ""
    assert story.sent == {"IPv4": 0, "IPv6": 0}


def test_unplugged_devices_come_back_without_a_restart(story):
    raw = _run(story, 1).tables["raw"]
    late_s = []
    for source, unplugged_s, replugged_s in story.outages:
        heard_s = (
            story.zero_s
            + raw["t_ns"][(raw["source"] == source.encode()) & (raw["sent"] == 0)] / 1e9
        )
        gap_s = heard_s[heard_s > replugged_s].min() - heard_s[heard_s < unplugged_s].max()
        late_s.append(gap_s - (replugged_s - unplugged_s))
    print(
        f"{len(late_s)} times unplugged, restarts {story.restarts}, longest gap beyond the fault "
        f"{max(late_s):.1f} s"
    )
    assert story.restarts == "0"
    assert max(late_s) <= 10.0


def test_a_card_that_is_read_only_for_a_while_loses_nothing(story):
    run = _run(story, 1)
    heard_s = story.zero_s + run.tables["fixes"]["t_ns"] / 1e9
    begun_s, ended_s = story.read_only_s
    gap_s = np.diff(heard_s[(heard_s > begun_s - 2.0) & (heard_s < ended_s + 10.0)]).max()
    said = [
        row["text"].decode()
        for row in run.tables["notes"]
        if row["code"] in {b"write-failed", b"write-resumed"}
    ]
    print(
        f"read-only for {ended_s - begun_s:.0f} s: longest gap between fixes {gap_s:.2f} s; {said}"
    )
    assert gap_s < 3.0


def test_the_run_that_was_cut_is_whole_but_for_its_end(story, capsys):
    run = _run(story, 1)
    lost_s = story.cut_s - (story.zero_s + run.tables["raw"]["t_ns"].max() / 1e9)
    with capsys.disabled():
        print(f"\ncut: last byte {lost_s:.1f} s before it; {run.damage}")
    assert run.end is None
    assert not run.damage.missing_frames
    assert sealing_of(run.path).broken_at is None
    _smooth(run, capsys)
    assert lost_s <= 3.0  # two, and the second between two words of the receiver


def test_the_run_without_a_clock_is_sealed_and_knows_its_utc(story, capsys):
    run = _run(story, 2)
    fixes = run.tables["fixes"]
    base = fit(fixes["t_ns"], fixes["utc_ns"], fixes["valid"])
    utc_s = base.utc_ns(0) / 1e9 - (UTC_START.timestamp() + story.again_zero_s - story.walk_begun_s)
    with capsys.disabled():
        print(f"\n{story.clock_of_second_boot.split()}; UTC of the run is off by {utc_s:.2f} s")
    assert "1970-01-01" in story.clock_of_second_boot
    assert abs(utc_s) < 1.0  # between the clocks of two machines, one of them emulated
    assert postproc(["info", "--verify", str(run.path)]) == 0
    assert "digest" in capsys.readouterr().out
    _smooth(run, capsys)


def _smooth(run, capsys):
    assert len(run.tables["readings"]) > 10
    assert postproc(["smooth", str(run.path), "--json"]) == 0
    cells = json.loads(capsys.readouterr().out)
    with capsys.disabled():
        print(
            f"\n{run.path.name}: {len(run.tables['fixes'])} fixes, "
            f"{len(run.tables['readings'])} readings, {str(cells)[:300]}"
        )
