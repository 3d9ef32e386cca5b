"""Figures of the code and of its documents: `make house`; `--write` commits those of today.

Ends with 1 where modules, classes, types of an answer or words are more than in `house.json`.
"""

import ast
import json
import re
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import click

ROOT = Path(__file__).resolve().parents[1]
COMMITTED = Path(__file__).with_suffix(".json")
PACKAGES = ("logger", "postproc")
MAY_NOT_RISE = (
    "modules", "classes", "types of an answer", "words of documents", "words of docstrings",
    "words of --help",
)  # fmt: skip
MOST_LINES = 800
"""No module is longer."""
N_LARGEST = 10

ANSWERS = frozenset({
    "Answer", "Best", "BestPosition", "BestWithout", "CellDetail", "CellEstimate", "CellResult",
    "CellSection", "CellStatus", "CellView", "Decision", "Estimate", "FinalState", "LeastSquares",
    "LiveEstimate", "LivePosition", "LiveVerdict", "LocatedCell", "Mode", "ModeStatus",
    "NamedPosition", "NextWalk", "PositionStatus", "Posterior", "StrongestMode", "StrongestStatus",
    "TargetStatus", "Without",
})  # fmt: skip
"""Types that say where a cell is or how sure that is. A name that is gone drops out."""
SAYS_WHERE = frozenset({
    "verdict", "r50_m", "r95_m", "modes", "region", "region50", "region95", "ellipse95", "drms_m",
})  # fmt: skip
"""A class with two of these fields is a type of an answer, whatever its name is."""
READINGS = frozenset({
    "CellBlocks", "CellObservations", "Heard", "HeardCell", "HeardRow", "LevelAtPoint",
    "LevelReading", "Levels", "PlaceLevels", "Reading", "Readings", "ReadingsInOrder", "Rows",
    "Sighting", "SpikeLevel", "Spot", "StrongestReading", "WalkReadings", "_Level", "_Levels",
})  # fmt: skip
"""Types that carry the readings of a cell. A name that is gone drops out."""
LEVELS = frozenset({"level_dbm", "rssi_dbm", "levels", "dbm", "levels_dbm", "limit_dbm"})
"""A class with one of these and a place is a type of readings, whatever its name is."""
_FLOATS = re.compile(r"\btuple\[float(?:, float){1,3}\]")
_UNTYPED = re.compile(r"\bdict\[str, (?:object|Any)\]|\bJson\b")
_PAIRS = tuple(
    (re.compile(rf"(?<![a-z0-9]){one}(?![a-z0-9])"), other)
    for one, other in (("x", "y"), ("lat", "lon"), ("east", "north"), ("easting", "northing"))
)
Function = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass
class Module:
    """One source file."""

    name: str
    path: Path
    text: str
    tree: ast.Module
    imports: set[str] = field(default_factory=set)

    @property
    def n_lines(self) -> int:
        """Lines with the blank ones."""
        return len(self.text.splitlines())

    @property
    def first_sentence(self) -> str:
        """What the module is, by its own docstring."""
        first = (ast.get_docstring(self.tree) or "no docstring").split("\n\n")[0]
        return re.split(r"(?<=\.) ", " ".join(first.split()))[0]


def modules(root: Path = ROOT) -> list[Module]:
    """All modules of the two packages, with the modules that each imports."""
    found = []
    for package in PACKAGES:
        for path in sorted((root / package).rglob("*.py")):
            parts = path.relative_to(root).with_suffix("").parts
            name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
            text = path.read_text()
            found.append(Module(name, path.relative_to(root), text, ast.parse(text)))
    names = {module.name for module in found}
    for module in found:
        module.imports = (_imported(module, names) & names) - {module.name}
    return found


def _imported(module: Module, names: set[str]) -> set[str]:
    """Names of modules, those imported inside functions too; not those for type checkers.

    `from package import module` names the module and not its package.
    """
    found = set()
    for node in _without_type_checking(module.tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module is not None:
            parts = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= parts if parts <= names else {*parts, node.module}
    return found


def _without_type_checking(node: ast.AST) -> Iterator[ast.AST]:
    yield node
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test):
            continue
        yield from _without_type_checking(child)


def circles(found: Sequence[Module]) -> list[list[str]]:
    """Groups of modules that import each other (Tarjan's strongly connected components)."""
    edges = {module.name: sorted(module.imports) for module in found}
    number: dict[str, int] = {}
    lowest: dict[str, int] = {}
    stack: list[str] = []
    groups = []

    def visit(name: str) -> None:
        number[name] = lowest[name] = len(number)
        stack.append(name)
        for other in edges[name]:
            if other not in number:
                visit(other)
            if other in stack:
                lowest[name] = min(lowest[name], lowest[other])
        if lowest[name] == number[name]:
            group = stack[stack.index(name) :]
            del stack[stack.index(name) :]
            if len(group) > 1:
                groups.append(sorted(group))

    sys.setrecursionlimit(10_000)
    for name in edges:
        if name not in number:
            visit(name)
    return groups


def functions(found: Iterable[Module]) -> Iterator[Function]:
    """Every function and method."""
    for module in found:
        for node in ast.walk(module.tree):
            if isinstance(node, Function):
                yield node


def classes(found: Iterable[Module]) -> Iterator[ast.ClassDef]:
    """Every class, those within functions and classes too."""
    for module in found:
        yield from (node for node in ast.walk(module.tree) if isinstance(node, ast.ClassDef))


def fields_of(node: ast.ClassDef) -> dict[str, str]:
    """Annotated fields with their annotations."""
    return {
        line.target.id: ast.unparse(line.annotation)
        for line in node.body
        if isinstance(line, ast.AnnAssign) and isinstance(line.target, ast.Name)
    }


def has_pair(annotations: dict[str, str]) -> bool:
    """Whether x and y, latitude and longitude, or a tuple of two to four floats stand there."""
    if any(_FLOATS.search(text) for text in annotations.values()):
        return True
    return any(
        word.search(name) and word.sub(other, name) in annotations
        for word, other in _PAIRS
        for name in annotations
    )


def annotations_of(function: Function) -> dict[str, str]:
    """Arguments with their annotations, and what is returned."""
    arguments = function.args
    every = (*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs)
    known = {one.arg: ast.unparse(one.annotation) if one.annotation else "" for one in every}
    return known | ({"return": ast.unparse(function.returns)} if function.returns else {})


def n_returned(function: Function) -> int:
    """How many values without names a tuple that is returned has; 0 for any other type."""
    for node in ast.walk(function.returns) if function.returns else ():
        if isinstance(node, ast.Subscript) and ast.unparse(node.value) == "tuple":
            parts = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
            if not any(isinstance(part, ast.Constant) and part.value is ... for part in parts):
                return len(parts)
    return 0


def is_answer(node: ast.ClassDef) -> bool:
    """Whether a class is a type of an answer, by its name or its fields."""
    return node.name in ANSWERS or len(SAYS_WHERE & fields_of(node).keys()) >= 2


def is_readings(node: ast.ClassDef) -> bool:
    """Whether a class is a type of readings, by its name or its fields."""
    known = fields_of(node)
    has_place = has_pair(known) or any("Places" in text for text in known.values())
    return node.name in READINGS or (has_place and bool(LEVELS & known.keys()))


def words_of_docstrings(found: Iterable[Module]) -> int:
    """Words of the texts that stand alone in modules, classes and functions."""
    return sum(
        len(node.value.value.split())
        for module in found
        for node in ast.walk(module.tree)
        if isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )


def words_of_documents(root: Path = ROOT) -> int:
    """Words of pages in the repository, without those of the tests."""
    command = ["git", "ls-files", "*.md", "*.rst", "*.txt", ":!tests"]
    names = subprocess.run(command, cwd=root, check=True, capture_output=True, text=True).stdout
    paths = (root / name for name in names.splitlines())
    return sum(len(path.read_text().split()) for path in paths if path.exists())


def words_of_help() -> int:
    """Words that `--help` of every command prints at 80 columns."""
    # only here, so that a tree can be measured whose commands do not start
    from logger.cli import program as fieldlogger  # noqa: PLC0415
    from postproc.cli import program as postproc  # noqa: PLC0415

    return sum(_words_of_command(one) for one in (fieldlogger, postproc))


def _words_of_command(command: click.Command, parent: click.Context | None = None) -> int:
    # click keeps the option --help as the first context has named it, for all later ones
    settings = {**command.context_settings, "terminal_width": 80}
    context = click.Context(command, parent, command.name, **settings)
    names = command.list_commands(context) if isinstance(command, click.Group) else []
    commands = [command.get_command(context, name) for name in names]
    inner = sum(_words_of_command(one, context) for one in commands if one is not None)
    return len(command.get_help(context).split()) + inner


def figures(found: Sequence[Module]) -> dict[str, float]:
    """All figures by their names."""
    every_class, every_function = list(classes(found)), list(functions(found))
    kinds = Counter(isinstance(node, ast.expr) for one in found for node in ast.walk(one.tree))
    n_lines = sum(module.n_lines for module in found)
    late = {
        id(node)
        for function in every_function
        for node in ast.walk(function)
        if isinstance(node, ast.Import | ast.ImportFrom)
    }
    return {
        "lines of Python": n_lines,
        "AST nodes": kinds.total(),
        "expression nodes a line": round(kinds[True] / n_lines, 2),
        "modules": len(found),
        "classes": len(every_class),
        "functions": len(every_function),
        "function-level imports": len(late),
        "import circles": len(circles(found)),
        "types of an answer": sum(map(is_answer, every_class)),
        "types of readings": sum(map(is_readings, every_class)),
        "classes with a pair of coordinates": sum(has_pair(fields_of(c)) for c in every_class),
        "signatures with a pair of coordinates": sum(
            has_pair(annotations_of(one)) for one in every_function
        ),
        "functions that return dict[str, object]": sum(
            bool(_UNTYPED.search(annotations_of(one).get("return", ""))) for one in every_function
        ),
        "functions that return 3 or more unnamed values": sum(
            n_returned(one) >= 3 for one in every_function
        ),
        f"modules over {MOST_LINES} lines": sum(one.n_lines > MOST_LINES for one in found),
        "words of documents": words_of_documents(),
        "words of docstrings": words_of_docstrings(found),
        "words of --help": words_of_help(),
    }


def main(arguments: Sequence[str]) -> int:
    """Print the figures beside the committed ones; the exit code says whether one has risen."""
    if list(arguments) not in ([], ["--write"], ["--list"]):
        print("usage: python tools/house.py [--write|--list]", file=sys.stderr)
        return 2
    found = modules()
    if list(arguments) == ["--list"]:
        _print_lists(found)
        return 0
    now = figures(found)
    if list(arguments) == ["--write"]:
        COMMITTED.write_text(json.dumps(now, indent=2) + "\n")
    then: dict[str, float] = json.loads(COMMITTED.read_text())
    risen = [name for name in MAY_NOT_RISE if now[name] > then[name]]
    print(f"{'':48}{'now':>9}{'committed':>11}")
    for name, value in now.items():
        print(f"{name:48}{value:9}{then.get(name, ''):>11}{'  more' if name in risen else ''}")
    print(f"\nThe {N_LARGEST} largest modules")
    for module in sorted(found, key=lambda one: -one.n_lines)[:N_LARGEST]:
        print(f"{module.n_lines:5}  {module.path}: {module.first_sentence}")
    for circle in circles(found):
        print(f"circle: {' '.join(circle)}")
    for name in risen:
        print(f"more than committed: {name}, {now[name]} and not {then[name]}", file=sys.stderr)
    return 1 if risen else 0


def _print_lists(found: Sequence[Module]) -> None:
    """Each member of the figures that count a kind, for whoever wants to lower one."""
    for module in found:
        for node in ast.walk(module.tree):
            if isinstance(node, ast.ClassDef):
                kinds = {"answer": is_answer(node), "readings": is_readings(node),
                         "pair in a class": has_pair(fields_of(node))}  # fmt: skip
            elif isinstance(node, Function):
                known = annotations_of(node)
                kinds = {"pair in a signature": has_pair(known), "tuple": n_returned(node) >= 3,
                         "dict": bool(_UNTYPED.search(known.get("return", "")))}  # fmt: skip
            else:
                continue
            for kind in (kind for kind, is_one in kinds.items() if is_one):
                print(f"{kind}: {node.name} {module.path}:{node.lineno}")


if __name__ == "__main__":
    signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # `| head` ends it without a word
    sys.exit(main(sys.argv[1:]))
