"""Positions that a receiver has but has not measured: kept, weighed, and told."""

import json

import pytest

from logger.core.runfile import read_run
from logger.sim.devices import sentence
from logger.sim.ptys import PtyDevice
from postproc.cli import main as postproc
from tests.kit import service
from tests.kit.recorded_replies import NmeaPlayer


def _epochs(quality, mode, day="210926", n=8):
    out = []
    for second in range(n):
        clock, place = f"1200{second:02d}.00", f"5231.00000,N,01324.{second:05d},E"
        out += [
            sentence(f"GNRMC,{clock},A,{place},2.7,90.0,{day},,,{mode},V"),
            sentence(f"GNGGA,{clock},{place},{quality},00,9.9,34.0,M,40.0,M,,"),
        ]
    return b"".join(out)


def _record(folder, epochs):
    """The run of a service whose receiver sends these."""
    player = NmeaPlayer(epochs)
    with PtyDevice(player) as gnss:
        with service.running_service(
            service.site_toml(folder, str(folder / "none"), gnss.path)
        ) as logger:
            service.wait_for(player.finished.is_set)
            service.wait_for(lambda: service.n_recorded(folder / "runs", "fixes") == 8)
            service.stop_service(logger)
    (path,) = (folder / "runs").glob("run-*.h5")
    return path


@pytest.mark.parametrize(
    ("quality", "mode", "kept", "code", "n_valid"),
    [
        (1, "A", 1, None, 8),
        (6, "E", 6, "dead-reckoning", 8),
        (6, "A", 6, "dead-reckoning", 8),
        (1, "E", 6, "dead-reckoning", 8),
        (7, "M", 7, "position-by-hand", 0),
        (8, "S", 8, "position-simulated", 0),
        (1, "S", 8, "position-simulated", 0),
    ],
)
def test_they_are_told(tmp_path, capsys, quality, mode, kept, code, n_valid):
    path = _record(tmp_path, _epochs(quality, mode))
    run = read_run(path)
    assert run.tables["fixes"]["quality"].tolist() == [kept] * 8
    assert run.tables["fixes"]["valid"].sum() == n_valid
    codes = {row["code"].decode() for row in run.tables["notes"] if row["source"] == b"gnss"}
    assert codes - {"port-opened"} == ({code} if code else set())
    assert postproc(["info", str(path)]) == 0
    assert ("8 of these by dead reckoning" in capsys.readouterr().out) is (kept == 6)
    assert postproc(["info", str(path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["n_fixes_by_dead_reckoning"] == 8 * (kept == 6)


@pytest.mark.parametrize(("day", "dates"), [("040207", ["2007-02-04"]), ("210926", [])])
def test_a_date_before_a_rollover_is_noted_once(tmp_path, capsys, day, dates):
    path = _record(tmp_path, _epochs(1, "A", day))
    notes = read_run(path).tables["notes"]
    texts = [row["text"].decode() for row in notes if row["code"] == b"impossible-date"]
    assert [text.split()[0] for text in texts] == dates
    assert postproc(["info", str(path)]) == 0
    assert ("reported a date that cannot be" in capsys.readouterr().out) is bool(dates)
