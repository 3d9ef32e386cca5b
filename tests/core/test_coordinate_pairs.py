"""No pair of coordinates travels outside of `Places`, under any name or as a tuple."""

import ast
import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ALLOWED = Path(__file__).with_name("coordinate_pairs.toml")

HALVES = {
    "x": "y",
    "xs": "ys",
    "east": "north",
    "easting": "northing",
    "column": "row",
    "lat": "lon",
    "lats": "lons",
    "latitude": "longitude",
}
"""Words of two names that end alike: `x_m, y_m`, `a_x_m, a_y_m`, `lat_deg, lon_deg`."""
TUPLE = re.compile(r"\btuple\[(float|FloatArray)(, (float|FloatArray)){1,3}\]")


def partners(name):
    """Names that would make a pair with this one."""
    words = name.split("_")
    for i, word in enumerate(words):
        if word in HALVES:
            yield "_".join([*words[:i], HALVES[word], *words[i + 1 :]])


def has_pair(names):
    return any(other in names for name in names for other in partners(name))


def is_tuple(annotation):
    return annotation is not None and bool(TUPLE.search(ast.unparse(annotation)))


def loose(tree, name):
    """Qualified names of the functions and classes of a module with loose coordinates."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            arguments = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
            annotations = [*(one.annotation for one in arguments), node.returns]
            own = f"{name}.{node.name}"
            if has_pair({one.arg for one in arguments}) or any(map(is_tuple, annotations)):
                yield own
            yield from loose(node, own)
        elif isinstance(node, ast.ClassDef):
            fields = [one for one in node.body if isinstance(one, ast.AnnAssign)]
            own = f"{name}.{node.name}"
            if has_pair({ast.unparse(one.target) for one in fields}):
                yield own
            yield from loose(node, own)
        elif isinstance(node, ast.AnnAssign):
            if is_tuple(node.annotation):
                yield name
        else:
            yield from loose(node, name)


def all_loose():
    for package in ("logger", "postproc"):
        for path in sorted((ROOT / package).rglob("*.py")):
            module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
            yield from loose(ast.parse(path.read_text("utf-8")), module)


def test_each_pair_outside_of_places_is_listed_with_its_reason():
    table = tomllib.loads(ALLOWED.read_text("utf-8"))
    listed = [name for reason in table.values() for name in reason["names"]]
    assert len(listed) == len(set(listed))
    found = set(all_loose())
    assert sorted(found - set(listed)) == [], "coordinates travel in `logger.core.places.Places`"
    assert sorted(set(listed) - found) == [], "these have gone: remove them from the list"


@pytest.mark.parametrize(
    ("code", "names"),
    [
        ("def f(x_m: float, y_m: float) -> None: ...", ["m.f"]),
        ("def f(*, a_x_m: FloatArray, a_y_m: FloatArray): ...", ["m.f"]),
        ("def f(here: tuple[float, float]): ...", ["m.f"]),
        ("def f() -> list[tuple[FloatArray, FloatArray]]: ...", ["m.f"]),
        ("class A:\n    lat_deg: float\n    lon_deg: float", ["m.A"]),
        ("class A:\n    def f(self, easting, northing): ...", ["m.A.f"]),
        ("class A:\n    place: tuple[float, float, float]", ["m.A"]),
        ("def f(x_m, level_dbm) -> tuple[float, int]: ...", []),
        ("def f(places: Places) -> tuple[float, ...]: ...", []),
    ],
)
def test_a_pair_is_noticed_under_any_name(code, names):
    assert list(loose(ast.parse(code), "m")) == names
