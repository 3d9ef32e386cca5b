"""`make house` counts what it says, and ends with 1 where a figure has risen."""

import ast
import json
import os
import subprocess
import sys

import pytest

from tools import house

ONE = '''"""One module. It is small."""
from typing import TYPE_CHECKING
from postproc.two import place
if TYPE_CHECKING:
    from postproc.three import Unused

class Estimate:
    """A type of an answer."""
    x_m: float
    y_m: float

class Renamed:
    verdict: str
    r95_m: float

class Bare:
    level_dbm: float

def where(at: tuple[float, float]) -> dict[str, object]:
    import json
'''
TWO = '''"""Another module."""
def place(lat_deg, lon_deg) -> tuple[int, int, int]:
    from postproc.one import where
'''


@pytest.fixture
def small_tree(tmp_path):
    (tmp_path / "postproc").mkdir()
    for name, text in (("one", ONE), ("two", TWO), ("three", "")):
        (tmp_path / f"postproc/{name}.py").write_text(text)
    return house.modules(tmp_path)


def test_figures_of_a_small_tree(small_tree):
    figures = house.figures(small_tree)
    assert {name: figures[name] for name in list(figures)[3:14]} == {
        "modules": 3,
        "classes": 3,
        "functions": 2,
        "function-level imports": 2,
        "import circles": 1,
        "types of an answer": 2,
        "types of readings": 0,
        "classes with a pair of coordinates": 1,
        "signatures with a pair of coordinates": 2,
        "functions that return dict[str, object]": 1,
        "functions that return 3 or more unnamed values": 1,
    }
    assert figures["lines of Python"] == len((ONE + TWO).splitlines())
    assert figures["words of docstrings"] == 12
    assert house.circles(small_tree) == [["postproc.one", "postproc.two"]]


@pytest.mark.parametrize(
    ("arguments", "is_pair"),
    [
        ("x_m, y_m", True),
        ("start_lat_deg, start_lon_deg", True),
        ("target_x, target_y", True),
        ("east_m, north_m", True),
        ("box: tuple[float, float, float, float]", True),
        ("x_m, z_m", False),
        ("lattice, lonttice", False),
        ("levels: tuple[float, ...]", False),
    ],
)
def test_a_pair_of_coordinates_under_any_name(arguments, is_pair):
    function = ast.parse(f"def f({arguments}): ...").body[0]
    assert house.has_pair(house.annotations_of(function)) is is_pair


def test_a_figure_that_has_risen_is_an_error(small_tree, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(house, "modules", lambda: small_tree)
    committed = tmp_path / "house.json"
    monkeypatch.setattr(house, "COMMITTED", committed)
    assert house.main(["--write"]) == 0
    figures = json.loads(committed.read_text())
    committed.write_text(json.dumps(figures | {"modules": 1, "lines of Python": 1}))
    assert house.main([]) == 1
    assert capsys.readouterr().err == (
        f"more than committed: modules, {figures['modules']} and not 1\n"
    )


def test_a_reader_that_takes_one_line_ends_it_without_a_traceback():
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "w") as closed:
        command = [sys.executable, house.__file__, "--list"]
        ended = subprocess.run(command, stdout=closed, stderr=subprocess.PIPE, check=False)
    assert ended.stderr == b""
