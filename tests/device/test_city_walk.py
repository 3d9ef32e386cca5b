"""A walk through a city with a rogue station: named, followed and replayed, by the real service."""

import threading

from logger.config import parse_config
from logger.core.runfile import read_run
from logger.core.types import Note
from logger.device.clock import ScaledClock
from logger.device.service import Service
from logger.device.startup import begin_run
from logger.sim.ptys import PtyDevice, answering, talking
from logger.sim.scenario import scenario
from logger.sim.walk import WalkTime
from postproc.cli import main
from tests.kit.recorded_runs import record_until

ROGUE = "232-01-7777-4660"
SPEED = 40.0


def _notes(run):
    return [record.value for _, record in run.records("notes") if isinstance(record.value, Note)]


def _follows_rogue(recorded):
    """The rogue is suspicious, and since then it is the target."""
    texts = recorded.texts()
    is_named = any(text.startswith(f"{ROGUE}: suspicious") for text in texts)
    return is_named and any(text.startswith(f"target is {ROGUE}") for text in texts)


def test_the_rogue_of_a_city_is_named_and_followed(tmp_path, capsys):
    walk, clock = scenario("city-rogue", 1), ScaledClock(SPEED)
    time = WalkTime(clock)
    devices = answering(walk.modem(time.now_s)), talking(walk.receiver(), time)
    with PtyDevice(devices[0]) as modem, PtyDevice(devices[1]) as gnss:
        text = (
            f'[run]\ndirectory = "{tmp_path}"\n[modem]\nport = "{modem.path}"\n'
            f'poll_interval_s = 2.0\n[gnss]\nport = "{gnss.path}"\n'
            f'[live]\ntarget = "suspicious"\nmax_fix_age_s = {3.0 + 0.1 * SPEED}\n'
        )
        config = parse_config(text, "site.toml")
        service = Service(config, begin_run(config, text, clock), clock, threading.Event())
        service.start()
        record_until(service, clock, _follows_rogue)
        status = service.snapshot()
        path = service.stop("end of the test")
    assert _last_target(path).startswith(f"target is {ROGUE}")
    assert status.target.cell == ROGUE
    assert status.suspicions[0].cell == ROGUE
    assert [one.word for one in status.suspicions].count("suspicious") == 1
    assert main(["replay", str(path)]) == 0
    assert "replay equals live" in capsys.readouterr().out
    assert main(["suspect", str(path)]) == 0
    assert capsys.readouterr().out.startswith(f"{ROGUE}: suspicious")


def _last_target(path):
    """Before the rogue was named, it may have been the target as the strongest cell."""
    texts = [note.text for note in _notes(read_run(path))]
    return [text for text in texts if text.startswith("target is ")][-1]
