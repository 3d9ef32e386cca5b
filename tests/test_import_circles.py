"""No module needs one that needs it: neither at its top, in a function, for types, nor by name."""

import ast
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("logger", "postproc")


def modules_in(root: Path, packages: tuple[str, ...]) -> dict[str, Path]:
    """Files by the name under which they are imported."""
    found = {}
    for package in packages:
        for path in (root / package).rglob("*.py"):
            parts = path.relative_to(root).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def imports_of(module: str, path: Path, known: dict[str, Path]) -> Iterator[str]:
    """Modules that are imported anywhere in a file, or named in full by a text."""
    package = module.split(".") if path.name == "__init__.py" else module.split(".")[:-1]
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        match node:
            case ast.Import():
                yield from (name.name for name in node.names)
            case ast.ImportFrom():
                above = package[: len(package) - node.level + 1] if node.level else []
                origin = ".".join([*above, *filter(None, [node.module])])
                for name in node.names:
                    inner = f"{origin}.{name.name}"
                    yield inner if inner in known else origin
            case ast.Constant(value=str(text)) if "." in text:  # postproc is a command too
                yield text


def circle_in(modules: dict[str, Path]) -> list[str]:
    graph = {
        module: {name for name in imports_of(module, path, modules) if name in modules} - {module}
        for module, path in modules.items()
    }
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return error.args[1]
    return []


def test_the_two_programs_have_no_circle():
    modules = modules_in(ROOT, PACKAGES)
    assert "logger.core.runfile.run" in modules
    assert circle_in(modules) == []


@pytest.mark.parametrize(
    "back",
    [
        "import p.a",
        "from p import a",
        "from p.a import x",
        "from .a import x",
        "from . import a",
        "def f():\n    from p.a import x",
        "if TYPE_CHECKING:\n    from p.a import x",
        "NAME = 'p.a'",
    ],
)
def test_a_circle_is_found(tmp_path, back):
    folder = tmp_path / "p"
    folder.mkdir()
    (folder / "__init__.py").touch()
    (folder / "a.py").write_text("from p.b import y")
    (folder / "b.py").write_text("import c")
    assert circle_in(modules_in(tmp_path, ("p",))) == []
    (folder / "b.py").write_text(back)
    assert sorted(set(circle_in(modules_in(tmp_path, ("p",))))) == ["p.a", "p.b"]
