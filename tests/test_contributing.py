"""The four steps of CONTRIBUTING.md, followed in a copy of the tree."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
STEPS = (ROOT / "CONTRIBUTING.md").read_text().partition("## Add a modem")[2]
NAMES = {"<vendor>": "acme", "<family>": "acme_x"}

FILES = {
    "tests/drivers/data/ati/acme_x.txt": "ACME Ltd X20 Revision 1.0\n",
    "tests/drivers/data/own/acme_x.txt": "AT+ACELL?\n+ACELL: 262,01,1A2B,3C4D,-71\nOK\n",
    "logger/drivers/acme_x.py": '''"""Acme X20: the serving cell by AT+ACELL.

    AT+ACELL?
    +ACELL: 262,01,1A2B,3C4D,-71
    OK

Needs: nothing.
Known by: the maker.
Doubts: none.
Sources: invented for a test.
"""

import re
from collections.abc import Sequence

from logger.drivers.family import Claim, Family
from logger.drivers.protocols.at import Command
from logger.drivers.reading.row_language import Row, form, split

_ROW = re.compile(r"\\+ACELL: (.*)")
_CELL = form("GSM", "mcc! mnc! lac! cid16! rssi*")


class AcmeX(Family):
    """The serving cell by `AT+ACELL?`."""

    name = "acme_x"
    claim = Claim(maker=r"\\bACME Ltd\\b")
    poll_commands = (Command("AT+ACELL?"),)

    def rows_in(self, lines: Sequence[str]) -> tuple[Row, ...]:
        """Readings in +ACELL rows."""
        found = (row[1] for line in lines for row in _ROW.finditer(line))
        cells = (_CELL.cell("serving", split(text)) for text in found)
        return tuple(cell for cell in cells if cell is not None)
''',
    "firmware_notes/acme.md": "# Acme\n\n## acme_x: X20\n\n`AT+ACELL?` transmits nothing.\n",
    "tests/drivers/test_acme_x.py": """from logger.drivers.acme_x import AcmeX
from tests.kit.drivers import cells_of, own_replies


def test_a_reply():
    (cell,) = cells_of(AcmeX(), own_replies("acme_x")[0].split("\\n"))
    assert (cell.lac, cell.cid, cell.rssi_dbm) == (0x1A2B, 0x3C4D, -71.0)
""",
    "tests/kit/dialects/acme_x.py": '''"""Acme X20: AT+ACELL (invented for a test)."""

from logger.sim.world import Air
from logger.sim.dialects import (
    NO_SERVICE,
    SETTINGS,
    Answer,
    Dialect,
    Settings,
    identity_replies,
)


def serving_cell(air: Air, _: Settings) -> Answer:
    """The serving cell; area and cell are hexadecimal."""
    if air.serving is None:
        return NO_SERVICE
    cell = air.serving.cell
    where = f"{cell.mcc},{cell.mnc},{cell.lac:04X},{cell.cid:04X}"
    return [f"+ACELL: {where},{air.serving.dbm}"]


ACME_X = Dialect(
    "acme_x",
    identity_replies(["ACME Ltd X20"], "ACME Ltd", "X20", "1.0"),
    replies={"+ACELL?": serving_cell},
    settings=SETTINGS,
)
''',
}
"""What the steps ask for, by path; the driver is as small as one can be."""

COPIED = ("logger", "postproc", "tests", "firmware_notes", "pyproject.toml")
CHECKS = ("tests/drivers/test_driver_files.py", "tests/drivers/test_claims.py")


@pytest.fixture(scope="module")
def copy(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("scratch") / "cellwalk"
    folder.mkdir()
    for name in COPIED:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(source, folder / name)
    for path, text in FILES.items():
        (folder / path).parent.mkdir(exist_ok=True)
        (folder / path).write_text(text)
    return folder


def run(copy: Path, *command: str) -> subprocess.CompletedProcess[str]:
    """A Python program that imports the copy."""
    environment = {**os.environ, "PYTHONPATH": str(copy), "PYTHONDONTWRITEBYTECODE": "1"}
    return subprocess.run(
        [sys.executable, *command],
        cwd=copy,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )


def check(copy: Path, *paths: str) -> subprocess.CompletedProcess[str]:
    """Tests of the copy."""
    return run(copy, "-m", "pytest", "-q", "-p", "no:cacheprovider", *paths)


def test_the_steps_name_the_files_and_nothing_else():
    paths = set(re.findall(r"`([\w/]*<[\w<>/]*\.\w+)`", STEPS))
    for mark, name in NAMES.items():
        paths = {path.replace(mark, name) for path in paths}
    assert paths == set(FILES)


def test_the_other_files_and_names_of_the_steps_exist():
    for path in re.findall(r"`((?:logger|tests)/[\w/]+\.\w+)`", STEPS):
        assert (ROOT / path).is_file(), path
    family = (ROOT / "logger/drivers/family.py").read_text()
    for name in ("class Family", "claim", "rows_in"):
        assert re.search(rf"\b{name}\b", family), name
    assert "FAMILY = {" in (ROOT / "tests/device/test_modem_source.py").read_text()


def test_the_checks_pass_for_a_driver_made_by_the_steps(copy):
    done = check(
        copy,
        *CHECKS,
        "tests/drivers/test_acme_x.py",
        "tests/sim/test_dialects.py",
        "tests/drivers/test_registry.py",
    )
    assert done.returncode == 0, done.stdout
    assert re.search(r"\b[1-9]\d* passed", done.stdout)
    linted = run(copy, "-m", "ruff", "check", "--no-cache", "logger/drivers/acme_x.py")
    assert linted.returncode == 0, linted.stdout


def test_the_new_driver_reads_its_replies_by_name_and_by_itself(copy):
    reply = "tests/drivers/data/own/acme_x.txt"
    for options in (["--driver", "acme_x"], []):
        done = run(copy, "-m", "logger.cli", "parse", *options, reply)
        assert done.returncode == 0, done.stderr
        assert "lac=6699  cid=15437" in done.stdout
        assert done.stderr == "1 row, driver acme_x\n"


@pytest.mark.parametrize("path", [path for path in FILES if "dialects" not in path])
def test_a_check_fails_while_a_file_is_missing(copy, path):
    missing = copy / path
    text = missing.read_text()
    missing.unlink()
    try:
        done = check(copy, CHECKS[0])
    finally:
        missing.write_text(text)
    assert done.returncode != 0, path
