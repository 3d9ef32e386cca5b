"""Colours and bars where somebody is looking, and nowhere else."""

import io
import re
import subprocess
import sys

import pytest
from rich.console import Console

from postproc import info_table, tables, terminal
from postproc.info import describe
from postproc.summary import summarise
from postproc.verification import tables as verify_tables
from tests.kit import runs
from tests.kit import sample_results as kit
from tests.kit.terminal import COLOUR, postproc


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    path = tmp_path_factory.mktemp("terminal") / "walk.journal"
    records = runs.records(30)
    runs.write_journal(
        path, [*records, runs.Record(31 * 10**9, "logger", runs.Note("warning", "x", "look here"))]
    )
    return str(path)


@pytest.mark.parametrize("command", ["info", "smooth"])
def test_coloured_on_a_terminal_and_not_for_those_who_say_so(run, command):
    output_of, code = postproc(command, run)
    assert code == 0
    assert COLOUR.search(output_of)
    plain, code = postproc(command, run, NO_COLOR="1")
    assert code == 0
    assert not COLOUR.search(plain)
    assert "262-01-4711-1" in plain


def test_a_bar_on_a_terminal_only(run):
    output_of, _ = postproc("smooth", run)
    assert "locating 262-01-4711-" in output_of  # the cell that is worked on
    assert "of 2" in output_of
    assert "left" in output_of
    piped = subprocess.run(
        [sys.executable, "-m", "postproc.cli", "smooth", run],
        capture_output=True,
        check=True,
        text=True,
    )
    assert "\x1b" not in piped.stdout + piped.stderr
    assert piped.stderr == ""


CONTROL = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")
WIDTHS = (60, 80)


def _numbers(text):
    return set(re.findall(r"[^\s,;:()]*\d[^\s,;:()]*", text))


@pytest.fixture
def outputs(tmp_path, monkeypatch):
    """What a printing function shows on a terminal so wide, or where nobody looks (None)."""

    def output_of(show, columns):
        file = io.StringIO()

        def console(**options):
            wide = (
                {"force_terminal": True, "width": columns, "color_system": None} if columns else {}
            )
            return Console(**{"file": file} | options | wide)

        monkeypatch.setattr(terminal, "Console", console)
        show()
        return file.getvalue()

    return output_of


def _all_at_once(tmp_path):
    run = kit.write_run(tmp_path / "walk.journal", seconds=120, cells=3)
    found = summarise(kit.sample_result(run, places=2))
    found.cells[0].cell = "310-410-65535-268435455"
    for key in ("batch", "ekf"):
        state = getattr(found.cells[0], key)
        state.lat, state.lon, state.p0_dbm, state.p0_sigma_db = (
            -12.34567,
            -123.45678,
            -105.6,
            1234.5,
        )
    verified = kit.sample_claims(kit.sample_result(run))
    return {
        "info": lambda: info_table.print_info(describe(run), details=True),
        "smooth": lambda: tables.print_summary(found, details=False),
        "smooth -v": lambda: tables.print_summary(found, details=True),
        "verify": lambda: verify_tables.print_verified(verified),
    }


@pytest.mark.parametrize("columns", WIDTHS)
@pytest.mark.parametrize("name", ["info", "smooth", "smooth -v", "verify"])
def test_no_number_is_cut_and_no_line_is_too_long(tmp_path, outputs, name, columns):
    show = _all_at_once(tmp_path)[name]
    whole, narrow = outputs(show, None), outputs(show, columns)
    assert _numbers(whole) <= _numbers(narrow)
    assert "…" not in narrow
    places = _numbers(str(tmp_path)) | {str(tmp_path)}
    long = [
        line
        for line in narrow.splitlines()
        if len(line) > columns and not any(p in line for p in places)
    ]
    # the digest is one word of 64 letters
    assert [line for line in long if not line.startswith("digest")] == []


@pytest.mark.parametrize("columns", WIDTHS)
def test_the_simulation_of_ranges_is_whole_too(outputs, columns):
    from postproc.reproductions.checks import print_checks
    from postproc.reproductions.toa import checks, setting, simulate

    wanted = setting(None, None, [0.01, 100.0], 20, 0)
    rows = list(simulate(wanted))
    whole, narrow = (
        outputs(lambda: print_checks(checks(wanted, rows, steps=True)), width)
        for width in (None, columns)
    )
    assert _numbers(whole) <= _numbers(narrow)


@pytest.mark.parametrize("columns", WIDTHS)
def test_a_real_terminal_gets_what_a_pipe_gets(run, columns):
    for command in (["info", "-v", run], ["smooth", "-v", run]):
        piped = subprocess.run(
            [sys.executable, "-m", "postproc.cli", *command],
            capture_output=True,
            check=True,
            text=True,
        )
        output_of, code = postproc(*command, columns=columns)
        assert code == 0
        output = CONTROL.sub("", output_of).replace(run, "").replace("\r", "")
        wrapped = {
            word for word in _numbers(piped.stdout.replace(run, "")) if len(word) < columns - 12
        }
        assert wrapped <= _numbers(output)


def test_one_line_a_cell_and_the_located_first(tmp_path, outputs):
    run = kit.write_run(tmp_path / "walk.journal", seconds=120, cells=33)
    found = summarise(kit.sample_result(run))
    found.cells.reverse()
    lines = outputs(lambda: tables.print_summary(found, details=False), 80).splitlines()
    rows = [line for line in lines if line.startswith("262-01-4711-")]
    assert len(rows) == 33
    assert [line.split()[2] for line in rows][:2] == ["located", "cannot"]
    assert len(lines) <= 33 + 6
    jargon = ("EKF", "least squares", "P0", "eta", "posterior", "reference", "RTS")
    assert not [word for word in jargon if any(re.search(rf"\b{word}\b", line) for line in lines)]


def test_at_most_ten_events_the_gravest_of_them(tmp_path, outputs):
    from logger.core.runfile import read_run

    notes = [
        runs.Record(10**9 * i, "logger", runs.Note("info", "x", f"small matter {i}"))
        for i in range(31, 60)
    ]
    grave = runs.Record(61 * 10**9, "logger", runs.Note("error", "x", "grave matter"))
    runs.write_journal(tmp_path / "walk.journal", [*runs.records(30), *notes, grave])
    info = describe(read_run(tmp_path / "walk.journal"))
    short = outputs(lambda: info_table.print_info(info), 80)
    assert short.count("matter") + short.count("Grüße") == 10
    assert "grave matter" in short
    assert f"... and {len(info.events) - 10} more events (-v lists all)" in short
    every = outputs(lambda: info_table.print_info(info, details=True), 80)
    assert every.count("matter") + every.count("Grüße") == len(info.events)


def test_markup_in_a_run_is_text(tmp_path, outputs):
    run = kit.write_run(tmp_path / "walk.journal", seconds=120, cells=1)
    found = summarise(kit.sample_result(run))
    found.cells[0].cell = "[/bold]:smile:[red]"
    for details in (False, True):
        assert "[/bold]:smile:[red]" in outputs(
            lambda d=details: tables.print_summary(found, details=d), 80
        )


@pytest.mark.parametrize("columns", [None, 60, 80])
def test_nothing_in_a_run_steers_the_terminal(tmp_path, outputs, columns):
    from dataclasses import replace

    run = kit.write_run(tmp_path / "walk.journal", seconds=120, cells=1)
    found, info = summarise(kit.sample_result(run)), describe(run)
    evil = "\x1b]0;evil\x07\x1b[2J\u202e\r"
    found.run = replace(found.run, path=evil, warnings=[evil])
    found.cells[0].cell, found.cells[0].warnings = evil, [evil]
    cells = (replace(info.cells[0], cell=evil, rat=evil),)
    events = tuple(replace(event, text=evil, source=evil) for event in info.events)
    info = replace(
        info, path=evil, origin=evil, stopped=evil, cells=cells, events=events, started_utc=evil
    )
    for show in (
        lambda: tables.print_summary(found, details=False),
        lambda: tables.print_summary(found, details=True),
        lambda: info_table.print_info(info),
    ):
        output = outputs(show, columns)
        assert "evil" in output
        assert not set(CONTROL.sub("", output)) & set("\x1b\x07\r\u202e")
