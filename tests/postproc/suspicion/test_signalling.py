"""Signalling is listed with places, beside what is ordinary, and gives no cell a word."""

import json

import pytest

from logger.core.runfile import convert_journal, read_run
from logger.core.types import CellReading, Fix, Note, Record, Scan
from logger.sim.scenario import GRAZ
from postproc.cli import main
from postproc.suspicion.signalling import CODE, Signal, signals_of
from tests.kit import runs

SECOND_NS = 10**9
CELL = "LTE-1300-17"
NULL = Signal(0, "RRC security", "EEA0 EIA2", CELL, "262-01")
OTHERS = [NULL._replace(value="EEA2 EIA2", cell=f"LTE-1300-{k}") for k in range(18, 27)]
ABROAD = NULL._replace(operator="310-410")
RELEASE = NULL._replace(kind="release", value="to GERAN")
SIGNALS = (NULL, *OTHERS, ABROAD, RELEASE, NULL)
HARMLESS = Note("info", CODE, "no such form")


def run_of(tmp_path, signals, *, step_deg=1e-5):
    """A walk of a second a signal, each between two fixes."""
    cell = CellReading(
        "serving", "LTE", "262", "01", tac=4711, cid=1, arfcn=1300, pci=17, rsrp_dbm=-80.0
    )
    records = [Record(1, "import", HARMLESS)]
    for k in range(len(signals) + 1):
        t_ns = (k + 1) * SECOND_NS
        lat_deg = GRAZ.lat_deg + k * step_deg
        if step_deg:
            fix = Fix(True, lat_deg=lat_deg, lon_deg=GRAZ.lon_deg)
            records.append(Record(t_ns, "gnss", fix))
        records.append(Record(t_ns, "modem", Scan(t_ns, (cell,))))
        for one in signals[k : k + 1]:
            note = Note("info", CODE, one.text)
            records.append(Record(t_ns + SECOND_NS // 2, "import", note))
    tmp_path.mkdir(exist_ok=True)
    runs.write_journal(tmp_path / "run.journal", records)
    convert_journal(tmp_path / "run.journal", tmp_path / "run.h5")
    return tmp_path / "run.h5"


def test_each_signal_has_its_time_its_place_and_what_is_ordinary(tmp_path):
    path = run_of(tmp_path, SIGNALS)
    run = read_run(path)
    listed = signals_of([run])
    assert [(one.kind, one.value, one.cell, one.operator) for one in listed] == [
        one[1:] for one in SIGNALS
    ]
    first, *_, abroad, release, last = listed
    assert (first.n_same, first.n) == (last.n_same, last.n) == (2, 11)
    assert (abroad.n_same, abroad.n) == (release.n_same, release.n) == (1, 1)
    assert first.t_s == round(1.5 - run.meta.started_ns / 1e9, 3)
    assert first.lat_deg == pytest.approx(GRAZ.lat_deg + 0.5e-5, abs=1e-6)
    assert last.lat_deg == pytest.approx(GRAZ.lat_deg + 12.5e-5, abs=1e-6)


def test_the_command_lists_them(tmp_path, capsys):
    path = str(run_of(tmp_path, SIGNALS))
    assert main(["suspect", path, "--signalling", "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert len(content["signalling"]) == len(SIGNALS)
    assert {"cell", "lat_deg", "lon_deg", "utc", "n_same"} <= content["signalling"][0].keys()
    assert main(["suspect", path, "--signalling"]) == 0
    text = capsys.readouterr().out
    (line,) = [one for one in text.splitlines() if "EEA0" in one and "262-01" in one]
    assert "2 of 11" in line
    assert "47.0" in line
    assert "no accusation" in text


def test_signalling_gives_no_word(tmp_path, capsys):
    said = []
    for name, signals in (("with", SIGNALS), ("without", [*[HARMLESS] * len(SIGNALS)])):
        assert main(["suspect", str(run_of(tmp_path / name, signals)), "--json"]) == 0
        said.append(json.loads(capsys.readouterr().out))
    assert said[0] == said[1]
    assert said[0]["cells"]


def test_a_run_without_fixes_or_signals(tmp_path, capsys):
    (one,) = signals_of([read_run(run_of(tmp_path / "nowhere", [NULL], step_deg=0.0))])
    assert one.lat_deg is None
    assert one.lon_deg is None
    assert main(["suspect", str(run_of(tmp_path / "quiet", [])), "--signalling"]) == 0
    assert "no signalling was recorded" in capsys.readouterr().out


def test_the_report_has_them_folded(tmp_path):
    path = run_of(tmp_path, SIGNALS)
    page = tmp_path / "report.html"
    assert main(["report", str(path), "-o", str(page)]) == 0
    html = page.read_text()
    section = html[html.index('<h2 id="signalling">') :]
    assert html[: html.index('<h2 id="signalling">')].rstrip().endswith("<summary>")
    assert "to GERAN" in section[: section.index("</details>")]
    assert 'href="#signalling"' in html
