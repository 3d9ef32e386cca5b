"""The path-loss formula and its constant stand in one module; all others call it."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
HOME = ROOT / "logger" / "core" / "model" / "path_loss.py"
NO_LEVEL = {"postproc/notebook_plan.py", "postproc/view/scene.py"}
"""Logarithms of a scale bar and of areas."""


def logarithms(tree):
    """Lines with a decimal logarithm, or with the natural logarithm of ten."""
    for call in ast.walk(tree):
        if not isinstance(call, ast.Call):
            continue
        name = ast.unparse(call.func).rpartition(".")[2]
        ten = [ast.unparse(argument) for argument in call.args] in (["10"], ["10.0"])
        if name == "log10" or (name == "log" and ten):
            yield call.lineno


def sources():
    for top in ("logger", "postproc"):
        yield from sorted((ROOT / top).rglob("*.py"))


def test_the_formula_stands_in_one_module():
    found = {
        path.relative_to(ROOT).as_posix(): lines
        for path in sources()
        if path != HOME and (lines := list(logarithms(ast.parse(path.read_text()))))
    }
    assert {path: lines for path, lines in found.items() if path not in NO_LEVEL} == {}


@pytest.mark.parametrize(
    "code",
    [
        "z = p0 - 10 * eta * np.log10(d)",
        "level = p0 - eta * 5.0 * log10(d2)",
        "C = 10.0 / log(10.0)",
        "C = 10 / math.log(10)",
    ],
)
def test_a_copy_of_it_would_be_seen(code):
    assert list(logarithms(ast.parse(code))) == [1]
    assert list(logarithms(ast.parse(HOME.read_text())))
