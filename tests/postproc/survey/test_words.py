"""Words of suspicion in the results of a survey: those of `postproc suspect`, each asked once."""

import json
from dataclasses import replace

import pytest

from logger.core.runfile import read_sound_run
from logger.core.suspicion.rules import RULES, rules_version
from logger.core.suspicion.words import strongest_reasons
from logger.core.types import Broadcast
from postproc.cli import main
from postproc.summary import sentence
from postproc.survey.dataset import Survey
from postproc.survey.intake import add_files
from postproc.survey.rule_inputs import rule_inputs, run_of
from postproc.suspicion.run_assessment import assess_runs, track
from tests.kit.html_page import with_spaces
from tests.postproc.baseline.walks import cell, write_walk

FOREIGN = "310-260-9-77"


def _readings(k, with_foreign):
    """Five cells of a place, and one of another continent that is strong from the first scan on."""
    home = [cell(cid, -80.0 - cid - k % 3, channel=20 + cid) for cid in range(1, 6)]
    lists = Broadcast((21, 22, 23), cro_db=4, penalty_time=3)
    home[0] = cell(1, -78.0, channel=21, broadcast=lists, c1=20, c2=24)
    home.append(cell(None, -95.0, channel=33))
    if with_foreign:
        other = cell(77, -55.0 - k % 2, lac=9, channel=99)
        home.append(type(other)("neighbour", "GSM", "310", "260", 9, cid=77, arfcn=99, bsic=1,
                                rssi_dbm=-55.0, ta=1))  # fmt: skip
    return tuple(home)


@pytest.fixture
def files(tmp_path):
    """Two walks with a foreign cell, and one without."""
    return [
        write_walk(tmp_path, n, lambda k, n=n: _readings(k, n < 2), n=60, lon_deg=13.4 + 1e-3 * n)
        for n in range(3)
    ]


def test_the_rules_find_the_same_in_what_a_survey_keeps(files):
    for file in files:
        run = read_sound_run(file)
        tracker = track(run_of(rule_inputs(run)))
        expected = track(run).assessments()
        assert tracker.assessments() == expected
        assert any(one.findings for one in expected) == (file != files[2])


def test_readings_are_kept_as_the_rules_see_them(files):
    run = read_sound_run(files[0])
    (_, kept), *_ = run_of(rule_inputs(run)).records("scans")
    (_, own), *_ = run.records("scans")
    assert kept.value.readings == own.value.readings
    assert kept.value.readings[0].broadcast.neighbour_arfcns == (21, 22, 23)


@pytest.fixture
def folder(files, tmp_path):
    survey = Survey.open_or_make(tmp_path / "s")
    list(add_files(survey, files, "one"))
    return survey.folder


def _locate(capsys, folder, scheduler, *arguments):
    assert main(["survey", "locate", str(folder), "--scheduler", scheduler, "--json",
                 *arguments]) == 0  # fmt: skip
    found = json.loads(capsys.readouterr().out)
    assert "may be missed" in found["unnoticed"]
    return {one["cell"]: one for one in found["cells"]}


def test_worst_word_over_all_runs(files, folder, scheduler, capsys):
    cells = _locate(capsys, folder, scheduler)
    one_run = {one.cell: one for one in assess_runs([read_sound_run(files[0])]).cells}
    found = cells[FOREIGN]
    assert found["word"] == one_run[FOREIGN].word == "suspicious"
    assert found["word_runs"] == 2
    assert set(found["word_rules"]) == {finding.rule.id for finding in one_run[FOREIGN].findings}
    words = {name: one["word"] for name, one in cells.items() if name != FOREIGN}
    assert words.pop("GSM-33-9") is None  # the rules ask about identities
    assert set(words.values()) == {"nothing unusual"}
    # each run is asked once: nothing is left for a scheduler
    assert _locate(capsys, folder, "tcp://127.0.0.1:1") == cells
    main(["survey", "locate", str(folder), "--scheduler", "tcp://127.0.0.1:1"])
    shown = " ".join(capsys.readouterr().out.split())
    assert f"{FOREIGN} is suspicious in 2 runs: network 310-260" in shown
    assert shown.index("is suspicious") < shown.index("verdict")
    assert "even a strong new station may be missed" in shown


def test_a_cell_of_one_scan_has_no_word(files, folder, scheduler, capsys):
    """No rule was asked about it, nor about one without an identity."""
    readings = lambda k: [cell(1, -80.0 - k % 3), *[cell(8, -80.0, channel=8)] * (k == 5)]  # noqa: E731
    list(add_files(Survey.open(folder), [write_walk(files[0].parent, 9, readings)], "one"))
    cells = _locate(capsys, folder, scheduler)
    assert cells["262-01-801-8"]["n_scans"] == 1
    assert cells["262-01-801-8"]["word"] is None
    assert cells["262-01-801-1"]["word"] == "nothing unusual"


def test_each_place_of_an_identity_has_its_own_word(files, folder, scheduler, capsys):
    """What is foreign in Berlin is at home in New York: two rows, of which one is suspicious."""

    def at_home(k):
        return [
            replace(cell(cid, -70.0 - k % 3, lac=9, channel=cid), mcc="310", mnc="260")
            for cid in range(77, 81)
        ]

    file = write_walk(files[0].parent, 9, at_home, n=30, lat_deg=40.7, lon_deg=-74.0)
    list(add_files(Survey.open(folder), [file], "one"))
    argv = ["survey", "locate", str(folder), "--scheduler", scheduler, "--cell", FOREIGN]
    assert main([*argv, "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["cells"]
    assert [(row["place"], row["n_runs"], row["word"], row["word_runs"]) for row in rows] == [
        (1, 2, "suspicious", 2),
        (2, 1, "unusual", 3),
    ]
    assert [row["word_rules"][-1] for row in rows] == ["S11", "S11"]
    assert main(argv) == 0
    said = " ".join(capsys.readouterr().out.split())
    places = "52.50° N, 13.40° E (2 runs, 2026-09-21); 40.70° N, 74.00° W (1 run, 2026-09-21)"
    heard = f"heard in 2 places, farther apart than a cell reaches: {places}"
    assert f"{FOREIGN} is unusual in 3 runs: {heard}" in said


def test_words_of_other_rules_are_asked_again(folder, scheduler, capsys, monkeypatch):
    cells = _locate(capsys, folder, scheduler)
    kept = folder / "words.jsonl"
    lines = kept.read_bytes().splitlines()
    assert len(lines) == 3
    kept.write_bytes(b"\n".join(lines)[:-20])  # torn
    assert _locate(capsys, folder, scheduler) == cells
    # a rule and nothing else
    monkeypatch.setitem(RULES, "X1", replace(RULES["S2"], id="X1"))
    assert _locate(capsys, folder, scheduler) == cells
    lines = kept.read_bytes().splitlines()
    assert len(lines) > 6
    assert {json.loads(line)["version"] for line in lines[-3:]} == {rules_version()}


def test_words_of_a_version_that_was_a_number_are_asked_again(folder, scheduler, capsys):
    cells = _locate(capsys, folder, scheduler)
    kept = folder / "words.jsonl"
    lines = [json.loads(line) for line in kept.read_bytes().splitlines()]
    old = [line | {"version": 6, "cells": []} for line in lines]
    kept.write_text("".join(f"{json.dumps(line)}\n" for line in old))
    assert _locate(capsys, folder, scheduler) == cells
    assert [json.loads(line) for line in kept.read_text().splitlines() if line] == old + lines


def test_the_map_begins_with_the_suspicious_cell_and_its_reasons(files, folder, scheduler, capsys):
    assert main(["survey", "map", str(folder), "--scheduler", scheduler]) == 0
    lead, others = with_spaces((folder / "survey.html").read_text()).split("All cells</h2>")
    assert "1 cell is suspicious" in lead
    assert f'<span class="no">1</span> <bdi class="cell">{FOREIGN}</bdi>' in lead
    (word,) = (one for one in assess_runs([read_sound_run(files[0])]).cells if one.cell == FOREIGN)
    assert sentence(strongest_reasons(word)[0]) in lead
    assert "2 runs say so" in lead
    assert others.count(FOREIGN) == 1
