import json
import re

import pytest

from logger.core.runfile import convert_journal
from logger.core.types import Fix, Note, Record, Scan
from logger.sim.scenario import GRAZ
from postproc.cli import main
from tests.kit import runs
from tests.kit.suspicion_walks import gsm

HOME = [gsm(cid, -80 - cid % 7) for cid in range(10, 16)]
ROGUE = gsm(99, -60, mcc="310", mnc="260")


def _run(tmp_path, *cells, name="run", start_ns=0, step_deg=0.0):
    records = []
    for k in range(20):
        t_ns = start_ns + (k + 1) * 5 * 10**9
        lat_deg = GRAZ.lat_deg + k * step_deg
        records.append(Record(t_ns, "gnss", Fix(True, lat_deg=lat_deg, lon_deg=GRAZ.lon_deg)))
        records.append(Record(t_ns, "modem", Scan(t_ns, tuple(cells))))
    run_id = name.encode().hex().ljust(32, "0")
    runs.write_journal(tmp_path / f"{name}.journal", records, run_id=run_id)
    convert_journal(tmp_path / f"{name}.journal", tmp_path / f"{name}.h5")
    return tmp_path / f"{name}.h5"


def _json(capsys, *argv):
    assert main(["suspect", *map(str, argv), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_the_rogue_comes_first_with_its_reasons(tmp_path, capsys):
    result = _json(capsys, _run(tmp_path, *HOME, ROGUE))
    first, *others = result["cells"]
    assert first["cell"] == "310-260-1201-99"
    assert first["word"] == "suspicious"
    assert first["score_nats"] > 5.0
    assert 0.0 < first["false_alarms_per_hour"] <= 0.1
    assert {finding["rule"] for finding in first["findings"]} >= {"P1", "L4"}
    finding = first["findings"][0]
    assert set(finding) == {"rule", "family", "text", "t_s", "lat", "lon", "evidence"}
    assert finding["lat"] == pytest.approx(GRAZ.lat_deg)
    assert 0.0 < finding["t_s"] <= 100.0
    assert {cell["word"] for cell in others} == {"nothing unusual"}
    assert {"T1", "B1", "P3"} <= set(result["not_asked"])


def test_the_text_has_reasons_rates_and_what_was_not_asked(tmp_path, capsys):
    assert main(["suspect", str(_run(tmp_path, *HOME, ROGUE))]) == 0
    text = capsys.readouterr().out
    assert text.startswith("310-260-1201-99: suspicious\n")
    assert "of United States of America, more than 40 km away" in text
    assert "Also seen with" in text
    assert "not checked, as these were missing: " in text
    assert not re.search(r"\b[A-Z]\d\]", text)
    assert main(["suspect", "-v", str(tmp_path / "run.h5")]) == 0
    assert re.search(r"; timing advance \(T1\)|\[L4\]", capsys.readouterr().out)
    assert "6 other cells: nothing unusual" in text


def test_the_stored_truth_is_not_read(tmp_path, capsys):
    clean = _json(capsys, _run(tmp_path, *HOME))
    assert all(not cell["findings"] for cell in clean["cells"])


def test_a_baseline_tells_new_cells_and_what_is_trusted(tmp_path, capsys):
    earlier = [_run(tmp_path, *HOME, name=f"e{i}", start_ns=i * 10**12) for i in range(7)]
    baseline = tmp_path / "baseline.db"
    assert main(["baseline", "add", *map(str, earlier), "-b", str(baseline)]) == 0
    capsys.readouterr()
    new = gsm(77, -70)
    run = _run(tmp_path, *HOME, new, name="today")
    (first, *_) = _json(capsys, run, "--baseline", baseline)["cells"]
    assert "B1" in [finding["rule"] for finding in first["findings"]]
    assert main(["baseline", "trust", first["cell"], "my femtocell", "-b", str(baseline)]) == 0
    capsys.readouterr()
    trusted = _json(capsys, run, "--baseline", baseline)
    assert not any(cell["findings"] for cell in trusted["cells"])


def test_a_cell_that_earlier_walks_always_heard_is_a_warning(tmp_path, capsys):
    north = {"step_deg": 2e-4}  # 22 m
    names = [f"e{i}" for i in range(7)]
    starts_ns = [i * 10**12 for i in range(7)]
    earlier = [
        _run(tmp_path, *HOME, gsm(50, -60), name=name, start_ns=start_ns, **north)
        for name, start_ns in zip(names, starts_ns, strict=True)
    ]
    baseline = tmp_path / "baseline.db"
    assert main(["baseline", "add", *map(str, earlier), "-b", str(baseline)]) == 0
    capsys.readouterr()
    today = _run(tmp_path, *HOME, name="today", **north)
    assert main(["suspect", str(today), "--baseline", str(baseline)]) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert text.startswith("232-01-1201-50: nothing unusual - 7 of 7 earlier walks heard it here")
    assert "6 other cells: nothing unusual" in text
    assert "Not measured: it only warns." in text


def test_replay_repeats_the_findings(tmp_path, capsys):
    from logger.core.live import LiveTracker
    from logger.core.live_settings import BEHIND, LiveSettings
    from logger.core.suspicion.rules import rules_note

    tracker = LiveTracker(LiveSettings())
    records = [Record(1, "live", rules_note())]
    for k in range(20):
        t_ns = (k + 1) * 5 * 10**9
        for record in (
            Record(t_ns, "gnss", Fix(True, lat_deg=GRAZ.lat_deg, lon_deg=GRAZ.lon_deg)),
            Record(t_ns, "modem", Scan(t_ns, (*HOME, ROGUE))),
        ):
            records.append(record)
            values = tracker.feed(len(records) - 1, record)
            records += [Record(t_ns, "live", v) for v in values if isinstance(v, Note)]
    assert [r.value.code for r in records if isinstance(r.value, Note)].count("finding") >= 2
    runs.write_journal(tmp_path / "a.journal", records)
    convert_journal(tmp_path / "a.journal", tmp_path / "a.h5")
    main(["replay", str(tmp_path / "a.h5"), "--json"])
    result = json.loads(capsys.readouterr().out)
    assert not result["findings_differ"]
    assert result["n_findings"] >= 3
    altered = [
        Record(r.t_ns, r.source, Note("info", "finding", "a: suspicious"))
        if isinstance(r.value, Note) and r.value.code == "finding"
        else r
        for r in records
    ]
    runs.write_journal(tmp_path / "b.journal", altered)
    convert_journal(tmp_path / "b.journal", tmp_path / "b.h5")
    assert main(["replay", str(tmp_path / "b.h5"), "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["findings_differ"]
    at = next(k for k, r in enumerate(records) if getattr(r.value, "code", "") == "finding")
    behind = [*records[:at], Record(records[at].t_ns, "live", Note("warning", BEHIND, "too slow"))]
    behind += [r for r in records[at:] if not isinstance(r.value, Note)]
    runs.write_journal(tmp_path / "c.journal", behind)
    main(["replay", str(tmp_path / "c.journal"), "--json"])
    assert not json.loads(capsys.readouterr().out)["findings_differ"]


def test_a_run_is_not_compared_with_itself(tmp_path, capsys):
    """Eight walks, one with a new cell, all in the baseline: the cell is new nevertheless."""
    days = range(8)
    others = [_run(tmp_path, *HOME, name=f"o{day}", start_ns=day * 10**12) for day in days]
    run = _run(tmp_path, *HOME, gsm(50, -70), start_ns=9 * 10**12)
    assert main(["baseline", "add", *map(str, [*others, run]), "-b", str(tmp_path / "b.db")]) == 0
    capsys.readouterr()
    result = _json(capsys, run, "--baseline", tmp_path / "b.db")
    rules = {one["rule"] for cell in result["cells"] for one in cell["findings"]}
    assert "B1" in rules
    assert result["earlier_walks"] == 8
    assert result["unnoticed"].startswith("Cells were heard for less than two minutes")
