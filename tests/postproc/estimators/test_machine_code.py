"""Without numba the loops run as Python, with the same results."""

import subprocess
import sys

import msgspec
import numpy as np
import pytest

from logger.core.runfile import finish_journal
from tests.kit.sample_results import write_run

SMOOTH = """
import sys
if sys.argv[1] == "without":
    sys.modules["numba"] = sys.modules["llvmlite"] = None
from postproc.cli import main
sys.exit(main(["smooth", sys.argv[2], "--json"]))
"""


def numbers(value) -> list[float]:
    """All numbers of a result in their order."""
    if isinstance(value, dict):
        return [n for key in sorted(value) if key != "run" for n in numbers(value[key])]
    if isinstance(value, list):
        return [n for item in value for n in numbers(item)]
    is_number = isinstance(value, float | int) and not isinstance(value, bool)
    return [float(value)] if is_number else []


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """The JSON of one run, with and without numba."""
    pytest.importorskip("numba", reason="pip install '.[post]'")
    answers = {}
    for mode in ("with", "without"):
        journal = tmp_path_factory.mktemp(mode) / "run-000017.journal"
        write_run(journal, seconds=120, cells=1)
        run = finish_journal(journal)
        command = [sys.executable, "-c", SMOOTH, mode, str(run)]
        done = subprocess.run(command, capture_output=True, check=True)
        answers[mode] = msgspec.json.decode(done.stdout)
    return answers


def test_numba_changes_no_result(results):
    machine, plain = numbers(results["with"]), numbers(results["without"])
    assert len(machine) > 50
    np.testing.assert_allclose(plain, machine, rtol=1e-6, atol=1e-6)
