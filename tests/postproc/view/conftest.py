"""A run of two minutes with results that need no estimating, and its recording."""

import pytest

from postproc.verification.claims import CellVerdict, Claim
from postproc.view.scene import write_scene
from tests.kit import sample_results as kit
from tests.kit.sample_view import sample_view


@pytest.fixture(scope="session")
def result(tmp_path_factory):
    run = kit.write_run(tmp_path_factory.mktemp("scene") / "walk.journal", seconds=120, cells=3)
    return kit.sample_result(run, places=2, verdict="ambiguous")


@pytest.fixture(scope="session")
def claim():
    name = kit.cell_name(0)
    position = Claim(name, kit.LAT, kit.LON, 30.0, "somebody")
    return CellVerdict(name, 60, position, "rejected", ("too <far>",))


@pytest.fixture(scope="session")
def view(result, claim):
    return sample_view(result, [claim])


@pytest.fixture(scope="session")
def recording_path(view, tmp_path_factory):
    """The recording's file."""
    path = tmp_path_factory.mktemp("scene") / "walk.rrd"
    write_scene(view, path)
    return path
