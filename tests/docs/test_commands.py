"""Every shell command in the documentation is run, or checked where it cannot be run here."""

import gzip
import re
import shlex
import shutil
from pathlib import Path

import pytest

from logger import probe
from logger.core.runfile import finish_journal
from postproc.verification.celldb import COLUMNS
from tests.docs import commands, known_names
from tests.docs.pages import PAGES, ROOT, name_of, shell_lines
from tests.kit.diag_capture import gps_lines, rayhunter_zip, stream
from tests.kit.sample_results import LAT, LON, write_run

NOT_RUN = {
    "postproc view": "opens a window; tests/view runs it",
    "postproc replay": "needs a recorded live estimate; tests/postproc/test_replay.py runs it",
    "postproc share": "needs a longer walk; tests/postproc/interop/test_share.py runs it",
    "fieldlogger probe": "opens the serial ports of this machine",
    "fieldlogger doctor": "examines this machine; tests/doctor/test_examination.py runs it",
    "fieldlogger page": "serves until stopped; tests/page runs it",
    "fieldlogger status": "needs a running service; tests/device/test_status_text.py runs it",
    "fieldlogger run": "records until stopped; tests/device/test_service.py runs it",
    "fieldlogger simulate": "takes a minute; tests/sim/test_simulate_command.py runs it",
    "postproc survey locate": "takes long; tests/postproc/survey runs it",
    "postproc survey map": "takes long; tests/postproc/survey runs it",
    "postproc survey next": "takes long; tests/postproc/survey runs it",
    "postproc validate": "takes long; tests/postproc/reproductions runs it",
}
"""Commands of which only the name and the options are checked."""
CELL_ROW = f"GSM,262,1,4711,100,0,{LON},{LAT},1000,7,1,1282569574,1300155341,0\n"
PAGE_OF = {" ".join(line.split()): page for page in PAGES for line in shell_lines(page)}
OURS = [line for line in PAGE_OF if re.search(r"(?<!restart )\b(postproc|fieldlogger) ", line)]
OTHERS = [line for line in PAGE_OF if line not in OURS]


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A folder with every file that the commands of the documentation name."""
    folder = tmp_path_factory.mktemp("files")
    journal = folder / "run-000017.journal"
    write_run(journal, seconds=120, cells=1)
    run = finish_journal(journal)
    for name in ("run.h5", "a.h5"):
        shutil.copy(run, folder / name)
    write_run(folder / "b.journal", seconds=100, cells=1, speed_mps=1.1, run_id="b" * 32)
    finish_journal(folder / "b.journal")
    (folder / "DIR").mkdir()
    shutil.copy(journal, folder / "DIR")
    with gzip.open(folder / "cells.csv.gz", "wt") as cells:
        cells.write(",".join(COLUMNS) + "\n" + CELL_ROW)
    database = ["celldb", "import", str(folder / "cells.csv.gz"), "-o", str(folder / "cells.db")]
    assert commands.run("postproc", *database)[0] == 0
    shutil.copy(ROOT / "tests/drivers/data/sitch_sim800l_mode2.txt", folder / "reply.txt")
    shutil.copy(ROOT / "systemd/site.toml", folder / "site.toml")
    baseline = ["-b", str(folder / "baseline.db")]
    assert commands.run("postproc", "baseline", "add", str(run), *baseline)[0] == 0
    for name, form in (("LOG", "wigle"), ("walk.gpx", "gpx")):
        assert commands.run("postproc", "export", str(folder / "run.h5"), "-o", str(folder / name),
                            "--format", form)[0] == 0  # fmt: skip
    added = ["survey", "add", str(run), "-o", str(folder / "survey")]
    assert commands.run("postproc", *added)[0] == 0
    for name in ("walk.qmdl", "walk.mi2log"):
        (folder / name).write_bytes(stream(range(20)))
    rayhunter_zip(folder / "recording.zip", stream(range(20)), gps_lines(range(0, 21, 5)))
    (folder / "TABLE").write_text(f"y,x,power,when\n{LAT},{LON},-70,12:00:00\n")
    return folder


def _words(line: str) -> list[str]:
    """Words of a command without `sudo` and without the shell around it."""
    inner = re.search(r"\$\((.*)\)", line)
    words = shlex.split(inner[1] if inner else line)
    return words[1:] if words[0] == "sudo" else words


def _id(line: str) -> str:
    return f"{name_of(PAGE_OF[line])}: {line}"


@pytest.mark.parametrize("line", OURS, ids=_id)
def test_our_commands_run(line, files, monkeypatch):
    monkeypatch.chdir(files)
    program, *arguments = _words(line)
    assert commands.fits(shlex.join([program, *arguments])), line
    if any(" ".join([program, *arguments]).startswith(name) for name in NOT_RUN):
        return
    if "HEX" in arguments:
        digest = re.search(r"[0-9a-f]{64}", commands.run("postproc", "info", "run.h5", "--json")[1])
        arguments[arguments.index("HEX")] = digest[0]
    code, output = commands.run(program, *arguments)
    assert code == 0, output


def test_commands_that_are_not_run_are_in_the_documentation():
    lines = [" ".join(_words(line)) for line in OURS]
    assert [name for name in NOT_RUN if not any(s.startswith(name) for s in lines)] == []


@pytest.mark.parametrize("line", OTHERS, ids=_id)
def test_other_commands_name_what_exists(line):
    """Installation and make change the machine or take long: their names are checked."""
    match _words(line):
        case ["make", target]:
            assert target in known_names.make_targets()
        case ["pip" | "pipx", "install", package]:
            assert package == "." or package.strip(".[]") in known_names.extras()
        case ["cp", source, target]:
            assert Path(source).name == Path(target).name == "site.toml"
        case ["scp", source, "."]:
            assert Path(source).parent.name == probe.SERVICE_FOLDER.name
        case ["systemctl", "start" | "restart", *units]:
            for unit in units:
                assert (ROOT / "systemd" / f"{unit}.service").is_file()
        case [script] if script.startswith("./"):
            assert (ROOT / script).stat().st_mode & 0o100
        case words:
            pytest.fail(f"unknown command: {words}")


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_our_scripts_can_be_executed(page):
    # also those that stand in blocks of text
    for script in re.findall(r"^(?:sudo )?\./(\S+\.sh)\b", page.read_text("utf-8"), re.MULTILINE):
        name = script if "/" in script else f"systemd/{script}"
        assert (ROOT / name).stat().st_mode & 0o111 == 0o111, script


def test_make_page_installs_the_libraries_of_the_page():
    rules = re.split(r"\n(?=\S+:)", (ROOT / "Makefile").read_text("utf-8"))
    recipes = {rule.partition(":")[0]: rule for rule in rules}
    needed = recipes["page"].splitlines()[0].split()[1:]
    extras = {
        extra
        for each in needed
        for listed in re.findall(r"-e '\.\[(.*?)\]'", recipes[each])
        for extra in listed.split(",")
    }
    assert "page" in extras
