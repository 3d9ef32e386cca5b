"""A cell that one scan has named is never spoken of; an unsure identity makes no cell."""

import json
from dataclasses import replace

import numpy as np
import pytest

from logger.core.runfile import read_run
from logger.core.types import Record, Scan
from postproc.cli import main
from postproc.info import describe
from postproc.scan_counts import heard_utc_ns, scans_of, too_rarely
from postproc.smoothing import smooth_runs
from tests.kit import runs, sample_results
from tests.kit.runs import reading

REAL, FALSE, UNSURE, BOTH = (f"262-01-4711-{cid}" for cid in (1, 77, 88, 99))


def records(n=60):
    """A bent walk past cell 1; one scan with ten rows of cell 77; cell 88 never named surely, cell
    99 twice.
    """
    rng = np.random.default_rng(3)
    out = []
    for i, record in enumerate(runs.records(n)):
        value = record.value
        if isinstance(value, Scan):
            k = sum(isinstance(one.value, Scan) for one in out)
            rows = [
                reading(1, -60.0 - 0.5 * abs(k - 30) + rng.normal()),
                replace(reading(88, -70.0), identity_unsure=True),
            ]
            rows += [reading(77, -10.0 - j) for j in range(10)] * (k == 20)
            rows += [replace(reading(99, -65.0 - k % 5), identity_unsure=k not in {10, 40})]
            out.append(Record(record.t_ns, record.source, replace(value, readings=tuple(rows))))
        elif hasattr(value, "lat_deg"):
            out.append(
                replace(record, value=replace(value, lat_deg=52.0 + 2e-5 * max(i // 3 - 30, 0)))
            )
        else:
            out.append(record)
    return out


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("run") / "a.journal"
    runs.write_journal(path, records())
    return path


def json_output(capsys, *argv):
    assert main([str(a) for a in argv]) == 0
    return json.loads(capsys.readouterr().out)


def test_scans_are_counted_not_readings(path):
    run = read_run(path)
    assert scans_of([run]) == {REAL: 60, FALSE: 1, UNSURE: 0, BOTH: 2}
    assert scans_of([run, run])[FALSE] == 2
    assert {cell.cell: cell.n_scans for cell in describe(run).cells} == scans_of([run])


def test_why_a_cell_is_not_spoken_of():
    assert too_rarely(1) == "observed in one scan only"
    assert too_rarely(0) == "its identity was never read without doubt"
    assert too_rarely(2) is None


def test_what_was_heard_once_is_never_located(path):
    found = {result.cell: result for result in smooth_runs([read_run(path)]).cells}
    assert (found[FALSE].verdict, found[FALSE].warnings) == (
        "cannot tell",
        ("observed in one scan only",),
    )
    assert (found[UNSURE].verdict, found[UNSURE].n_scans) == ("cannot tell", 0)
    # with a position, as `postproc survey` counts them
    assert (found[FALSE].n, found[FALSE].shares[0].n) == (10, 10)
    assert all(
        found[name].posterior is None and found[name].reference is None for name in (FALSE, UNSURE)
    )
    assert (found[REAL].n_scans, found[REAL].n) == (60, 60)
    assert found[REAL].posterior is not None
    assert (found[BOTH].n_scans, found[BOTH].n) == (2, 60)  # once known, its unsure levels count
    assert found[BOTH].posterior is not None


def test_every_output_says_where_a_cell_of_few_readings_was_heard(tmp_path, capsys):
    path, out = tmp_path / "few.journal", tmp_path / "out.csv"
    runs.write_journal(path, runs.records(3))
    says = "heard best at 52.0000 13.0000"
    for cell in json_output(capsys, "smooth", path, "--json")["cells"]:
        assert cell["warnings"][0].endswith(says)
    assert main(["smooth", str(path)]) == 0
    assert capsys.readouterr().out.count(says) == 2
    assert main(["export", str(path), "--estimates", "-o", str(out)]) == 0
    assert out.read_text().count(says) == 2
    assert main(["report", str(path), "-o", str(out)]) == 0
    page = out.read_text().replace("\N{NO-BREAK SPACE}", " ")
    assert page.count(says) >= 2
    assert page.count(">heard 52.0000 13.0000</td>") == 2


def test_json_says_in_how_many_scans(path, capsys):
    cells = json_output(capsys, "smooth", path, "--json")["cells"]
    assert {cell["cell"]: cell["n_scans"] for cell in cells} == {
        REAL: 60,
        FALSE: 1,
        UNSURE: 0,
        BOTH: 2,
    }
    (false,) = [cell for cell in cells if cell["cell"] == FALSE]
    assert (false["best"]["lat"], false["region95"]["area_m2"], false["modes"]) == (None, None, [])
    assert {
        cell["cell"]: cell["n_scans"]
        for cell in json_output(capsys, "info", path, "--json")["cells"]
    }[FALSE] == 1


def test_scans_of_several_runs_add_up(path, tmp_path):
    other = tmp_path / "b.journal"
    again = runs.on_another_day([replace_names(record) for record in records()])
    runs.write_journal(other, again, run_id="1" * 32)
    found = {one.cell: one for one in smooth_runs([read_run(path), read_run(other)]).cells}
    assert (found[FALSE].n_scans, found[FALSE].verdict) == (1, "cannot tell")
    assert found[FALSE].warnings == ("observed in one scan only",)
    assert found[REAL].n_scans == 120


def replace_names(record):
    """The same record without the false cell."""
    if not isinstance(record.value, Scan):
        return record
    kept = tuple(r for r in record.value.readings if r.cid != 77)
    return replace(record, value=replace(record.value, readings=kept))


def test_a_claim_about_it_is_not_tested(path, capsys):
    found = json_output(capsys, "verify", path, "--claim", "52.0,13.0", "--json")
    reasons = {cell["cell"]: (cell["verdict"], cell["reasons"]) for cell in found["cells"]}
    assert reasons[FALSE] == ("cannot tell", ["observed in one scan only"])
    assert reasons[UNSURE] == ("cannot tell", ["its identity was never read without doubt"])
    assert all("scan" not in reason for reason in reasons[REAL][1])
    assert sorted(found["heard_once"]) == [FALSE, UNSURE]


def test_without_a_claim_it_is_no_finding(path, tmp_path, capsys):
    claims = tmp_path / "claims.csv"
    claims.write_text(f"cell,lat,lon\n{REAL},52.0,13.0\n")
    found = json_output(capsys, "verify", path, "--claims", claims, "--json")
    assert found["without_claim"] == [BOTH]
    assert sorted(found["heard_once"]) == [FALSE, UNSURE]
    (sites,) = json_output(capsys, "verify", path, "--sites", "--cell", FALSE, "--json")["cells"]
    assert sites["why_not"] == "observed in one scan only"


def test_times_are_utc_over_all_runs_of_a_recorder_and_of_an_import(tmp_path):
    """In whatever order the runs are named; a run without UTC has none."""
    day_ns = 86_400 * 10**9
    first, later = (
        sample_results.write_run(
            tmp_path / f"{i}.journal",
            seconds=60,
            cells=1,
            utc0_ns=runs.UTC0_NS + i * day_ns,
            run_id=f"{i:032}",
        )
        for i in range(2)
    )
    begin_ns = runs.UTC0_NS + sample_results.START_NS + 200_000_000
    expected = begin_ns, begin_ns + day_ns + 58 * 10**9
    for named in ([first, later], [later, first]):
        heard = heard_utc_ns(named)[sample_results.cell_name(0)]
        assert heard == pytest.approx(expected, abs=1000)
    silent = sample_results.write_run(tmp_path / "s.journal", seconds=60, cells=1, utc=False)
    assert heard_utc_ns([silent]) == {}
    table, back = tmp_path / "w.csv", tmp_path / "i.h5"
    for argv in (("export", first.path, "-o", table), ("import", table, "-o", back)):
        assert main([str(a) for a in argv]) == 0
    imported = heard_utc_ns([read_run(back)])[sample_results.cell_name(0)]
    # the time of a level in a table is the middle of its scan
    assert imported[0] == pytest.approx(begin_ns - 100_000_000, abs=10**6)
    result = smooth_runs([later, first], [sample_results.cell_name(0)])
    (cell,) = result.cells
    assert result.answer(cell).provenance.runs == ("1.journal", "0.journal")
    assert cell.heard_utc_ns == pytest.approx(expected, abs=1000)
