"""What a command imports, and does not: a second of waiting is what heavy libraries cost."""

import json
import subprocess
import sys

import pytest

from tests.kit import runs

LOADED = """
import contextlib, io, json, sys
from importlib.util import _LazyModule
from postproc.cli import main
with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):
    main(json.loads(sys.argv[1]))
ran = [name for name, module in sys.modules.items() if type(module) is not _LazyModule]
print(json.dumps(sorted(ran)))
"""
HEAVY = {
    "scipy",
    "llvmlite",
    "matplotlib",
    "shapely",
    "rerun",
    "pyarrow",
    "PIL",
    "jinja2",
    "pyproj",
    "pandas",
}
LIBRARIES = HEAVY | {"numpy", "h5py", "msgspec", "rich", "threadpoolctl", "serial", "pynmea2"}


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    path = tmp_path_factory.mktemp("imports") / "walk.journal"
    runs.write_journal(path, runs.records(30))
    return str(path)


def _modules_after(*arguments):
    done = subprocess.run(
        [sys.executable, "-c", LOADED, json.dumps(arguments)], capture_output=True, check=True
    )
    return set(json.loads(done.stdout))


def test_help_imports_no_library():
    assert not _modules_after("--help") & LIBRARIES


@pytest.mark.parametrize(
    "command", ["smooth", "info", "import", "export", "report", "view", "verify", "plot", "survey"]
)
def test_help_of_a_command_imports_no_library(command):
    assert not _modules_after(command, "--help") & LIBRARIES


def test_the_python_interface_imports_what_it_needs_at_once_alone():
    code = "import json, sys, postproc.api; print(json.dumps(sorted(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)
    assert not set(json.loads(done.stdout)) & (HEAVY - {"shapely", "pyproj"})


@pytest.mark.parametrize("more", [(), ("-v",), ("--json",), ("--verify",)])
def test_info_imports_what_it_shows_and_nothing_more(run, more):
    loaded = _modules_after("info", run, *more)
    assert "numpy" in loaded
    assert not loaded & HEAVY
    assert "h5py" not in loaded  # HDF5 is read in another process
    assert not [
        n
        for n in loaded
        if n.startswith(("postproc.estimators", "postproc.smoothing", "logger.core.locator."))
    ]


@pytest.fixture(scope="module")
def estimated_run(run):
    subprocess.run([sys.executable, "-m", "postproc.cli", "smooth", run], check=True)
    return run


def test_smooth_imports_nothing_to_draw_with_and_no_general_optimiser(estimated_run):
    loaded = _modules_after("smooth", estimated_run)
    assert "logger.core.walker_kalman" in loaded  # it has estimated anew
    assert not loaded & {"matplotlib", "rerun", "PIL", "jinja2", "pandas", "scipy.stats"}
    assert "scipy.optimize" not in loaded


@pytest.mark.parametrize(
    ("argv", "drawn_with"),
    [
        (["report", "-o", "x.html"], {"matplotlib", "PIL", "jinja2"}),
        (["plot", "-o", "x.png"], {"matplotlib", "PIL"}),
        (["export", "--estimates", "-o", "x.kml"], set()),
    ],
)
def test_a_stored_result_is_shown_without_estimators(estimated_run, tmp_path, argv, drawn_with):
    command, *options, output = argv
    loaded = _modules_after(command, estimated_run, *options, str(tmp_path / output))
    assert loaded & HEAVY == {"pyproj", "shapely"} | drawn_with
    assert not loaded & {"h5py", "postproc.smoothing", "logger.core.walker_kalman"}


def test_recover_imports_no_estimator(run, tmp_path):
    assert not _modules_after("recover", str(tmp_path)) & HEAVY
