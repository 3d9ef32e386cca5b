"""Faults planted one by one into a copy of the code; the named test has to notice each.

`make planted-faults`, or `python tools/planted_faults.py ROOM ...` for some of them. A fault is an
expression of Python and what stands in its place. The expression is searched in all of `logger/`
and `postproc/`, whatever the file and the line breaks; a name that ends in `__` stands for any
expression. So a fault outlives moves. One whose expression is gone is reported and is an error:
write it anew for the code that does the same now.
"""

import ast
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("logger", "postproc")
TIMEOUT_S = 900.0
Bound = dict[str, ast.AST]


class Fault(NamedTuple):
    """An expression and its fault.

    `tests` are functions that notice it, searched by name in all of `tests/`, with parameters where
    there are some; if all are gone, the tests of `folder` run. The fault is planted `everywhere`,
    or its expression has to stand in one place.
    """

    room: str
    what: str
    old: str
    new: str
    folder: str
    tests: tuple[str, ...] = ()
    everywhere: bool = False


FAULTS = (
    Fault(
        "recording",
        "what is on the card is written again",
        "self._pending.clear()",
        "len(self._pending)",
        "tests/core/runfile/test_recovery.py",
        ("test_a_run_in_several_files_is_one",),
    ),
    Fault(
        "redaction",
        "an unknown line passes with its text",
        "A__[:end] + mask_text(A__[end:])",
        "A__",
        "tests/drivers/protocols/test_redaction.py",
        ("test_of_an_unknown_line_its_length_and_its_name_remain",),
        everywhere=True,
    ),
    Fault(
        "framing",
        "a line begun before the command answers it",
        "A__ or bool(self._buffer or self._torn)",
        "A__",
        "tests/drivers/protocols",
        ("test_line_begun_before_the_command_does_not_answer_it",),
    ),
    Fault(
        "timebase",
        "UTC without the drift of the crystal",
        "A__ + B__ + round(C__ * B__)",
        "A__ + B__",
        "tests/core/test_timebase.py",
        ("test_drift_of_a_crystal_over_a_long_walk",),
    ),
    Fault(
        "driver",
        "an RSRP of index 0 is 1 dB too high",
        "A__(97, -141.0)",
        "A__(97, -140.0)",
        "tests/drivers/reading",
        ("test_levels_without_a_cell",),
    ),
    Fault(
        "model",
        "the weight of uncertain positions is not normalised",
        "np.asarray(sum(map(np.log, A__)), float)",
        "np.asarray(0.0 * sum(map(np.log, A__)), float)",
        "tests/core/model",
        ("test_log_evidence_is_the_integral_over_p0_eta_and_sigma",),
    ),
    Fault(
        "locator",
        "a region that is too wide is no reason",
        "A__ > within_m",
        "A__ < 0.0",
        "tests/core/locator/test_verdict.py",
        ("test_large_region",),
    ),
    Fault(
        "live",
        "walking during a scan adds nothing to the error of its position",
        "A__.less_sure(TIMING_S * B__.speed_mps)",
        "A__",
        "tests/test_fixtures.py",
        ("test_a_run_replays_to_the_bit",),
    ),
    Fault(
        "filter",
        "too little fresh shadowing for the distance moved",
        "A__ * A__ * (1.0 - B__ * B__)",
        "A__ * A__ * (1.0 - B__)",
        "tests/core/test_shadow_ekf.py",
        ("test_consistent_with_its_own_world",),
    ),
    Fault(
        "smoother",
        "too little noise between two readings",
        "A__.shadow_db ** 2 * (1.0 - B__ ** 2)",
        "A__.shadow_db ** 2 * (1.0 - B__)",
        "tests/postproc/estimators/test_rts.py",
        ("test_agrees_with_dense_batch_solution",),
    ),
    Fault(
        "least squares",
        "half of the standard deviation",
        "A__ @ B__.covariance_db2 @ A__.T",
        "A__ @ B__.covariance_db2 @ A__.T / 4.0",
        "tests/postproc/estimators",
        ("test_covariance_is_true",),
    ),
    Fault(
        "suspicion",
        "every other cell seems to have the same area code",
        "A__.area == area and A__ is not B__",
        "A__ is not B__",
        "tests/core/suspicion",
        ("test_l1_l2_an_area_that_no_other_cell_has",),
    ),
    Fault(
        "guidance",
        "the forecast forgets the levels already heard",
        "A__ + B__ @ known.T",
        "A__",
        "tests/core/guidance",
        ("test_is_the_conditional_of_the_joint_gaussian",),
    ),
    Fault(
        "report",
        "longitude before latitude",
        "f'{about}{A__:.{decimals}f} {B__:.{decimals}f}'",
        "f'{about}{B__:.{decimals}f} {A__:.{decimals}f}'",
        "tests/postproc/report",
        ("test_a_cell_without_a_position_has_advice",),
    ),
    Fault(
        "import",
        "each row is a scan of its own",
        "groupby(A__, key=key)",
        "groupby(A__, key=id)",
        "tests/postproc/interop",
        ("test_rows_of_one_time_are_one_scan",),
    ),
    Fault(
        "survey",
        "offsets of modems with the wrong sign",
        "np.where(A__, offset_db, 0.0)",
        "np.where(A__, -offset_db, 0.0)",
        "tests/postproc/survey",
        ("test_offsets_have_the_errors_that_their_sigmas_say",),
    ),
    Fault(
        "baseline",
        "a walk that is there is added again",
        "self._rows(known, A__.digest, A__.content)",
        "self._rows(known, '', '')",
        "tests/postproc/baseline",
        ("test_a_journal_and_its_hdf5_file_are_one_walk",),
    ),
    Fault(
        "page",
        "a request by any name of the host is answered",
        "A__.headers.get('Host', '') not in B__",
        "A__.headers.get('Host', '') is None",
        "tests/page",
        ("test_strangers_and_other_paths_are_refused",),
    ),
    Fault(
        "replay",
        "estimates that differ count as equal",
        "len(A__) - len(different)",
        "len(A__)",
        "tests/postproc/test_replay.py",
        ("test_one_bit_is_noticed",),
    ),
    Fault(
        "share",
        "the ends of the walk are shown",
        "A__ > (1.0 + B__) * blur_m",
        "A__ > 0.1 * blur_m",
        "tests/postproc/interop",
        ("test_nothing_near_the_ends_is_left_at_any_time",),
    ),
)


class Place(NamedTuple):
    """Where the expression of a fault stands, and what would stand there."""

    path: Path
    node: ast.expr
    text: str


def read_trees(root: Path) -> dict[Path, ast.Module]:
    """The syntax trees of the two packages."""
    paths = sorted(path for package in PACKAGES for path in (root / package).rglob("*.py"))
    return {path: ast.parse(path.read_bytes()) for path in paths}


def places(fault: Fault, trees: Mapping[Path, ast.Module]) -> list[Place]:
    """All places of the expression of a fault."""
    old = ast.parse(fault.old, mode="eval").body
    new = ast.parse(fault.new, mode="eval").body
    found = []
    for path, tree in trees.items():
        for node in ast.walk(tree):
            bound: Bound = {}
            if isinstance(node, ast.expr) and _matches(old, node, bound):
                found.append(Place(path, node, f"({_filled(new, bound)})"))
    return sorted(found, key=lambda one: (one.path, one.node.lineno, one.node.col_offset))


def _matches(pattern: ast.AST, node: ast.AST, bound: Bound) -> bool:
    if isinstance(pattern, ast.Name) and pattern.id.endswith("__"):
        known = bound.setdefault(pattern.id, node)
        return ast.dump(known) == ast.dump(node)
    if type(pattern) is not type(node):
        return False
    return all(
        _are_equal(getattr(pattern, name, None), getattr(node, name, None), bound)
        for name in pattern._fields
        if name != "ctx"
    )


def _are_equal(pattern: object, value: object, bound: Bound) -> bool:
    if isinstance(pattern, list) and isinstance(value, list):
        pairs = zip(pattern, value, strict=False)
        return len(pattern) == len(value) and all(_are_equal(a, b, bound) for a, b in pairs)
    if isinstance(pattern, ast.AST) and isinstance(value, ast.AST):
        return _matches(pattern, value, bound)
    return type(pattern) is type(value) and pattern == value


class _Filling(ast.NodeTransformer):
    def __init__(self, bound: Bound) -> None:
        self._bound = bound

    def visit_Name(self, node: ast.Name) -> ast.AST:
        return self._bound.get(node.id, node)


def _filled(pattern: ast.expr, bound: Bound) -> str:
    return ast.unparse(_Filling(bound).visit(ast.parse(ast.unparse(pattern), mode="eval")))


def plant(found: Sequence[Place]) -> dict[Path, bytes]:
    """Write the fault into its places; returns the files as they were."""
    before = {place.path: place.path.read_bytes() for place in found}
    for place in reversed(found):
        lines = place.path.read_bytes().splitlines(keepends=True)
        starts = [sum(map(len, lines[:k])) for k in range(len(lines))]
        node, text = place.node, b"".join(lines)
        begin = starts[node.lineno - 1] + node.col_offset
        end = starts[(node.end_lineno or 0) - 1] + (node.end_col_offset or 0)
        place.path.write_bytes(text[:begin] + place.text.encode() + text[end:])
    return before


def targets(fault: Fault, root: Path) -> list[str]:
    """What pytest runs: the named tests wherever they are now, else the folder."""
    files = sorted((root / "tests").rglob("test_*.py"))
    texts = {path: path.read_text() for path in files}
    named = [
        f"{path.relative_to(root)}::{name}"
        for name in fault.tests
        for path, text in texts.items()
        if re.search(rf"^def {name.partition('[')[0]}\(", text, re.MULTILINE)
    ]
    return named or ([fault.folder] if (root / fault.folder).exists() else [])


def copy_tree(target: Path) -> None:
    """Copy what is in the repository, as it is now."""
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    names = subprocess.run(command, cwd=ROOT, check=True, capture_output=True).stdout.split(b"\0")
    for name in filter(None, map(os.fsdecode, names)):
        if (ROOT / name).is_file():
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, target / name)


def run_tests(tests: Sequence[str], root: Path) -> tuple[int, str]:
    """Exit code of pytest, and the name of the first test that failed."""
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider"]
    command += ["-m", "not slow", *tests]
    environ = os.environ | {"PYTHONPATH": str(root)}
    try:
        done = subprocess.run(
            command,
            check=False,
            cwd=root,
            env=environ,
            capture_output=True,
            text=True,
            timeout=TIMEOUT_S,
        )
    except subprocess.TimeoutExpired:
        return -1, "the tests do not end"
    failed = re.findall(r"^(?:FAILED|ERROR) \S*?([\w.]+::\w+|\S+)", done.stdout, re.MULTILINE)
    return done.returncode, failed[0] if failed else done.stdout.strip().rpartition("\n")[2]


def rows(faults: Sequence[Fault], root: Path) -> Iterator[tuple[Fault, bool, str]]:
    """Each fault, whether it was noticed, and by which test or why not."""
    trees = read_trees(root)
    for fault in faults:
        found, tests = places(fault, trees), targets(fault, root)
        if not found:
            yield fault, False, f"no longer there: {fault.old}"
        elif len(found) > 1 and not fault.everywhere:
            where = ", ".join(f"{p.path.relative_to(root)}:{p.node.lineno}" for p in found)
            yield fault, False, f"stands in {len(found)} places: {where}"
        elif not tests:
            yield fault, False, f"its tests are no longer there: {fault.folder}"
        else:
            before = plant(found)
            code, text = run_tests(tests, root)
            for path, content in before.items():
                path.write_bytes(content)
            yield fault, code == 1, text if code == 1 else f"not noticed by {tests}: {text}"


def main(rooms: Sequence[str]) -> int:
    """Print a line for each fault; the exit code is 1 where one was not noticed."""
    unknown = set(rooms) - {fault.room for fault in FAULTS}
    if unknown:
        print(f"no fault of {', '.join(sorted(unknown))}", file=sys.stderr)
        return 2
    chosen = [fault for fault in FAULTS if not rooms or fault.room in rooms]
    os.nice(10)
    with tempfile.TemporaryDirectory(prefix="planted-") as name:
        root = Path(name) / "cellwalk"
        copy_tree(root)
        every = sorted({test for fault in chosen for test in targets(fault, root)})
        code, text = run_tests(every, root)
        if code != 0:
            print(f"the tests fail without a fault: {text}", file=sys.stderr)
            return 1
        n_noticed = 0
        for fault, is_noticed, text in rows(chosen, root):
            n_noticed += is_noticed
            verdict = "noticed" if is_noticed else "MISSED"
            print(f"{verdict:8} {fault.room:14} {fault.what}\n{'':24}{text}", flush=True)
    print(f"{n_noticed} of {len(chosen)} faults were noticed")
    return 0 if n_noticed == len(chosen) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
