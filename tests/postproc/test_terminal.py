"""Colours and bars where somebody is looking, and nowhere else."""

import re
import subprocess
import sys
from dataclasses import replace

import msgspec
import pytest

from logger.core.answer import Word
from logger.core.document import terminal_lines
from logger.core.runfile import read_run
from postproc.info import describe
from postproc.info import document_of as info_document
from postproc.reproductions import toa
from postproc.reproductions.checks import document_of as document_of_checks
from postproc.summary import document_of, summarise
from postproc.verification import claims as verification
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
    assert r"\u00" not in output_of  # the bar moves, and its sequences are not shown as text
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


def _lines_of(document, columns):
    """What a document shows on a terminal so wide, or where nobody looks (None)."""
    return "\n".join(terminal_lines(document, columns)) + "\n"


def _all_at_once(tmp_path):
    run = kit.write_run(tmp_path / "walk.journal", seconds=120, cells=3)
    found = summarise(kit.sample_result(run, places=2))
    answer = found.rows[0].answer
    wide = {"lat": -12.34567, "lon": -123.45678, "p0_dbm": -105.6, "p0_sigma_db": 1234.5}
    ends = answer.paths.ends
    ends = {key: msgspec.structs.replace(end, **wide) for key, end in ends.items()}
    paths = replace(answer.paths, ends=ends)
    found.rows[0] = found.rows[0]._replace(
        answer=replace(answer, cell="310-410-65535-268435455", paths=paths)
    )
    verified = kit.sample_claims(kit.sample_result(run))
    return {
        "info": lambda: info_document(describe(run), details=True),
        "smooth": lambda: document_of(found, details=False)[0],
        "smooth -v": lambda: document_of(found, details=True)[0],
        "verify": lambda: verification.document_of(verified),
    }


@pytest.mark.parametrize("columns", WIDTHS)
@pytest.mark.parametrize("name", ["info", "smooth", "smooth -v", "verify"])
def test_no_number_is_cut_and_no_line_is_too_long(tmp_path, name, columns):
    make = _all_at_once(tmp_path)[name]
    whole, narrow = _lines_of(make(), None), _lines_of(make(), columns)
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
def test_the_simulation_of_ranges_is_whole_too(columns):
    wanted = toa.setting(None, None, [0.01, 100.0], 20, 0)
    said = document_of_checks(toa.checks(wanted, list(toa.simulate(wanted)), steps=True), {})
    assert _numbers(_lines_of(said, None)) <= _numbers(_lines_of(said, columns))


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


def _many(tmp_path, cells=33, **more):
    run = kit.write_run(tmp_path / "walk.journal", seconds=120, cells=cells)
    found = summarise(kit.sample_result(run, **more))
    found.rows.reverse()
    return found


def test_one_line_a_cell_and_the_located_first(tmp_path):
    lines = _lines_of(document_of(_many(tmp_path), details=False)[0], 80).splitlines()
    rows = [line for line in lines if line.startswith("262-01-4711-")][:12]
    assert [line.split()[1] for line in rows] == ["located"] + 11 * ["cannot"]
    assert "21 more cells cannot be located" in " ".join(lines)
    assert all("52.5" in line for line in rows)  # each has a position
    jargon = ("EKF", "least squares", "P0", "eta", "posterior", "reference", "RTS")
    assert not [word for word in jargon if any(re.search(rf"\b{word}\b", line) for line in lines)]


def test_no_cell_with_an_answer_or_a_word_is_folded(tmp_path):
    found = _many(tmp_path)
    for i, (verdict, word) in enumerate([("located", None), ("cannot tell", "unusual")]):
        said = word and Word(word, 4.0, (), "cell")
        answer = replace(found.rows[20 + i].answer, verdict=verdict, word=said)
        found.rows[20 + i] = found.rows[20 + i]._replace(answer=answer)
    text = _lines_of(document_of(found, details=False)[0], 80)
    assert text.startswith(f"{found.rows[21].answer.cell} is unusual: ")
    assert text.splitlines()[1].startswith("Walk ")  # what to do, though nobody knows where
    for row in found.rows[20:22]:
        assert re.search(rf"^{row.answer.cell} ", text, re.MULTILINE)


def test_the_places_of_an_ambiguous_cell_are_listed_with_their_sizes(tmp_path):
    found = _many(tmp_path, 1, verdict="ambiguous", places=2)
    text = _lines_of(document_of(found, details=False)[0], 80)
    row = re.compile(r"^  place \d: \d+ % +52\.\d{5} 13\.\d{5} +(\d+) m +(\d+) m$", re.MULTILINE)
    sizes = row.findall(text)
    assert len(sizes) == 2
    assert all(int(likely) < int(surely) for likely, surely in sizes)


def test_a_radius_that_supposes_no_distant_mast_is_marked(tmp_path):
    run = kit.write_run(tmp_path / "walk.journal", seconds=120, cells=3)
    result = kit.sample_result(run)
    cells = [kit.as_if_distant(result.cells[0]), *result.cells[1:]]
    text = _lines_of(document_of(summarise(replace(result, cells=cells)), details=False)[0], 80)
    row, *others = [line for line in text.splitlines() if line.startswith("262-01-4711-10")]
    assert re.search(r" located .* \d+ m +\*\d+ m +1$", row)
    assert "*" not in "".join(others)
    assert "* if it is no distant mast: the levels fit one kilometres away as well" in text
    # of one cell there is no range
    assert re.search(r"In truth the position is \d+ m off; the 95 % region (holds|does not)", text)


def test_a_position_is_as_exact_as_it_is_known(tmp_path):
    found = _many(tmp_path, 1)
    place = found.rows[0].answer.place
    for r50_m, r95_m, digits in (
        (50, 150, 8),
        (200, 999, 7),
        (50, 1001, 7),
        (200, 1001, 6),
        (1000, 2000, 5),
    ):
        wide = msgspec.structs.replace(place, r50_m=float(r50_m), r95_m=float(r95_m))
        assert wide.where.startswith("52.5" if r95_m < 1000 else "about 52.5")
        assert len(wide.where.split()[-1]) == digits


def test_at_most_ten_events_the_gravest_of_them(tmp_path):
    notes = [
        runs.Record(10**9 * i, "logger", runs.Note("info", "x", f"small matter {i}"))
        for i in range(31, 60)
    ]
    grave = runs.Record(61 * 10**9, "logger", runs.Note("error", "x", "grave matter"))
    runs.write_journal(tmp_path / "walk.journal", [*runs.records(30), *notes, grave])
    info = describe(read_run(tmp_path / "walk.journal"))
    short = _lines_of(info_document(info), 80)
    assert short.count("matter") + short.count("Grüße") == 10
    assert "grave matter" in short
    assert f"... and {len(info.events) - 10} more events (-v lists all)" in short
    every = _lines_of(info_document(info, details=True), 80)
    assert every.count("matter") + every.count("Grüße") == len(info.events)


def test_markup_in_a_run_is_text(tmp_path):
    run = kit.write_run(tmp_path / "walk.journal", seconds=120, cells=1)
    found = summarise(kit.sample_result(run))
    answer = replace(found.rows[0].answer, cell="[/bold]:smile:[red]")
    found.rows[0] = found.rows[0]._replace(answer=answer)
    for details in (False, True):
        said = document_of(found, details=details)[0]
        assert "[/bold]:smile:[red]" in _lines_of(said, 80)


@pytest.mark.parametrize("columns", [None, 60, 80])
def test_nothing_in_a_run_steers_the_terminal(tmp_path, columns):
    run = kit.write_run(tmp_path / "walk.journal", seconds=120, cells=1)
    found, info = summarise(kit.sample_result(run)), describe(run)
    evil = "\x1b]0;evil\x07\x1b[2J\u202e\r"
    found.runs[0] = replace(found.runs[0], path=evil, warnings=[evil])
    answer = replace(found.rows[0].answer, cell=evil, reasons=(evil,))
    found.rows[0] = found.rows[0]._replace(answer=answer)
    cells = (replace(info.cells[0], cell=evil, rat=evil),)
    events = tuple(replace(event, text=evil, source=evil) for event in info.events)
    info = replace(
        info, path=evil, origin=evil, stopped=evil, cells=cells, events=events, started_utc=evil
    )
    for said in (
        document_of(found, details=False)[0],
        document_of(found, details=True)[0],
        info_document(info),
    ):
        output = _lines_of(said, columns)
        assert "evil" in output
        assert not set(CONTROL.sub("", output)) & set("\x1b\x07\r\u202e")
