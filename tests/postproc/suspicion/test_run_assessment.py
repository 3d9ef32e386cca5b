"""Which cell the page and the viewer begin with."""

import pytest

from logger.core.document import terminal_lines
from logger.core.runfile import read_run
from logger.core.suspicion.words import assess
from logger.drivers.registry import FAMILIES
from postproc.ground import HeardIn
from postproc.smoothing import smooth_runs
from postproc.summary import document_of, summarise
from postproc.suspicion.run_assessment import (
    ALL_RULES,
    assess_runs,
    conspicuous_first,
    findings_at_desk,
    table_of_sources,
)
from postproc.view.view_model import select_cells
from tests.kit.suspicion_walks import gsm, write_scans, write_walk

HOME = [gsm(cid, -80 - cid % 7) for cid in range(10, 16)]
ROGUE = gsm(99, -60, mcc="310", mnc="260")


def _result(tmp_path, *cells):
    write_walk(tmp_path / "run.journal", cells)
    return smooth_runs([read_run(tmp_path / "run.journal")])


def test_the_suspicious_cell_is_the_one_of_interest(tmp_path):
    result, conspicuous = conspicuous_first(_result(tmp_path, *HOME, ROGUE))
    assert conspicuous == ("310-260-1201-99",)
    assert result.cells[0].cell == conspicuous[0]
    assert result.warnings[0].startswith("310-260-1201-99 is suspicious: ")
    assert [cell.word for cell in result.cells] == ["suspicious", *[""] * len(HOME)]
    assert "readings: suspicious; " in repr(result.cells[0])
    (shown,) = select_cells(result, conspicuous[:1])
    assert shown.cell == conspicuous[0]
    lines = list(terminal_lines(document_of(summarise(result), details=True)[0]))
    assert lines[0].startswith("310-260-1201-99 is suspicious: ")
    assert sum(line.strip().startswith("suspicious; ") for line in lines) == 1


def test_without_one_nothing_changes(tmp_path):
    before = _result(tmp_path, *HOME)
    after, conspicuous = conspicuous_first(before)
    assert conspicuous == ()
    assert [cell.cell for cell in after.cells] == [cell.cell for cell in before.cells]
    for cell in after.cells:
        word = after.answer(cell).word
        assert (word.word, word.findings) == ("nothing unusual", ())
        assert before.answer(cell).word is None  # it was not asked


def test_a_cell_of_one_scan_has_no_word(tmp_path):
    """Nothing was checked on it: all outputs say nothing, as `suspect` does."""
    home = [gsm(cid) for cid in range(10, 40)]
    write_scans(tmp_path / "run.journal", [home, [*home, ROGUE], home])
    run = read_run(tmp_path / "run.journal")
    result, _ = conspicuous_first(smooth_runs([run]))
    (once,) = [cell for cell in result.cells if cell.cell == ROGUE.cell]
    assert result.answer(once).word is None
    assert {cell.cell for cell in assess_runs([run]).cells} == result.words.keys()
    text = "\n".join(terminal_lines(document_of(summarise(result), details=False)[0]))
    assert "None of 30 cells is suspicious or unusual" in text
    assert "cannot be located, all for want of readings; none of 18 checked is unusual" in text


def test_more_cells_than_are_remembered_have_their_words(tmp_path):
    """The rules forget the cell heard longest ago, but they were asked about it."""
    several = [[gsm(cid, -80), gsm(cid + 1, -80)] for cid in range(1000, 1300)]
    write_scans(tmp_path / "run.journal", several)
    assert len(assess_runs([read_run(tmp_path / "run.journal")]).cells) == 299


@pytest.mark.parametrize(
    ("cell", "word"),
    [
        (HOME[0].cell, "unusual"),
        (
            gsm(1, mcc="001").cell,
            "nothing unusual",
        ),  # identities that anybody uses
        ("272-?-40122-7", "nothing unusual"),  # without its network another cell may be called so
    ],
)
def test_an_identity_in_two_cities_is_unusual(cell, word):
    places = [
        HeardIn(lat=lat, lon=lon, runs=("a",), n=9, first_utc=None, last_utc=None)
        for lat, lon in ((47.07, 15.44), (-12.05, -77.04))
    ]
    rules = [rule for rule in ALL_RULES if rule.id == "S11"]
    findings = list(findings_at_desk(rules, {cell: places}))
    assert assess(cell, findings).word == word
    assert "heard in 2 places, 11" in findings[0].text


def test_the_table_of_rules_has_each_rule_once_and_each_family():
    said, table, *unfed = table_of_sources()
    assert said.startswith("Generations")
    assert not unfed
    titles = [column.title for column in table.columns]
    assert titles == ["rules", *(name.replace("_", " ") for name in FAMILIES), "csv"]
    rows = {
        rule: dict(zip(titles, row, strict=True)) for row in table.rows for rule in row[0].split()
    }
    assert sorted(rows) == sorted(rule.id for rule in ALL_RULES)
    assert rows["N2"] | {"rules": ""} == dict.fromkeys(titles, "") | {"telit": "2", "csv": "2"}
    assert (rows["T1"]["sim800"], rows["T1"]["sierra"], rows["R1"]["sim800"]) == ("2", "", "")
