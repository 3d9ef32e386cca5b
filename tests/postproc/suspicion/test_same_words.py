"""The words of a run are those of the walk: live, replay and `suspect` agree to the bit."""

import json

import pytest

from benchmarks.suspicion_injection import Station, inject
from benchmarks.suspicion_logs import Log
from benchmarks.suspicion_patterns import KINDS
from logger.core.live import LiveTracker
from logger.core.live_settings import LiveSettings
from logger.core.runfile import convert_journal, read_sound_run
from logger.core.suspicion.rules import rules_note
from logger.core.suspicion.words import FINDING_CODE
from logger.core.types import Fix, Note, Record, Scan
from postproc.cli import main
from postproc.suspicion.run_assessment import assess_runs
from tests.kit import runs
from tests.kit.street import street
from tests.kit.suspicion_walks import LAT_DEG, LON_DEG, gsm


def _takeover():
    """A channel of six cells that gets another transmitter beside a walker who stands."""
    cells = tuple(gsm(cid, -80 - cid % 7) for cid in range(10, 16))
    records = []
    for k in range(9):
        t_ns = (k + 1) * 30 * 10**9
        heard = cells if k < 5 else (*cells[:5], gsm(15, -50))
        records.append(Record(t_ns, "gnss", Fix(True, lat_deg=LAT_DEG, lon_deg=LON_DEG)))
        records.append(Record(t_ns, "modem", Scan(t_ns, heard)))
    return records


def _scenario(kind):
    if kind == "takeover":
        return _takeover()
    return inject(Log("simulated", street(), 1.0 / 6.0), Station(kind, True)).records


@pytest.mark.parametrize("kind", [*KINDS, "takeover"])
def test_live_replay_and_suspect_say_the_same(tmp_path, capsys, kind):
    settings = LiveSettings(most_cells=1, environment="urban", antenna="omni")  # to be quick
    live = LiveTracker(settings)
    records = [Record(1, "live", rules_note())]
    for record in _scenario(kind):
        records.append(record)
        values = live.feed(len(records) - 1, record)
        records += [Record(record.t_ns, "live", one) for one in values if isinstance(one, Note)]
    notes = [one.value for one in records if isinstance(one.value, Note)]
    n_findings = sum(note.code == FINDING_CODE for note in notes)
    assert n_findings
    runs.write_journal(tmp_path / "run.journal", records, live=settings)
    convert_journal(tmp_path / "run.journal", tmp_path / "run.h5")

    main(["replay", str(tmp_path / "run.h5"), "--json"])  # estimates were not recorded here
    replayed = json.loads(capsys.readouterr().out)
    assert not replayed["findings_differ"]
    assert replayed["n_findings"] == n_findings + 1  # and which rules they are of
    at_desk = {cell.cell: cell for cell in assess_runs([read_sound_run(tmp_path / "run.h5")]).cells}
    assert at_desk == {cell.cell: cell for cell in live.suspicion.assessments()}
