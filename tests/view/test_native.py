"""The recording in the native viewer, drawn by a processor: software Vulkan, no screen."""

import socket
import time
from pathlib import Path

import pytest
from rerun.experimental import ViewerClient

from postproc.pictures import colours
from postproc.view import viewer
from postproc.view.scene import write_scene
from tests.kit import smoothed as kit
from tests.kit.canvas import count, missing
from tests.kit.stories import story

pytestmark = pytest.mark.slow

DRIVER = next(Path("/usr/share/vulkan/icd.d").glob("lvp_icd*.json"), None)
OPENS_S = 10.0
PATIENCE_S = 60.0
PLAN = (0.0, 0.8)
"""Of the plan's width; farther east is the key."""


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """A walk, and the same before anything was heard."""
    folder = tmp_path_factory.mktemp("native")
    found = kit.smoothed(kit.write_run(folder / "walk.journal", seconds=240, cells=4))
    write_scene(story(found), folder / "walk.rrd", online=False)
    nothing = kit.write_run(folder / "empty.journal", seconds=0, cells=1)
    write_scene(story(kit.Smoothed(nothing, None, (), ())), folder / "empty.rrd", online=False)
    return folder


@pytest.fixture
def client(tmp_path):
    """A viewer without a window, reachable from this machine only."""
    if DRIVER is None:
        pytest.skip("software Vulkan is missing (Debian: apt-get install mesa-vulkan-drivers)")
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    program = viewer.binary()
    environment = viewer.discreet(program, tmp_path) | {
        "VK_ICD_FILENAMES": str(DRIVER),
        "XDG_RUNTIME_DIR": str(tmp_path),
    }
    command = [str(program), "--headless", "--bind", "127.0.0.1", "--port", str(port), "--expect-data-soon"]
    with (tmp_path / "log").open("wb") as log, viewer.child(command, environment, log.fileno()):
        yield connected(port)


def connected(port):
    until = time.monotonic() + PATIENCE_S
    while time.monotonic() < until:
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
        time.sleep(0.05)
    raise TimeoutError("the viewer does not answer")


def view_named(client, name):
    return next(view.view_id for view in client.get_state().views if view.name == name)


def settled(client, name):
    """A picture of one view that no longer changes: the first may be half drawn."""
    before, until = None, time.monotonic() + PATIENCE_S
    while time.monotonic() < until:
        now = client.take_screenshot(view_named(client, name))
        if now == before:
            return now
        before = now
        time.sleep(0.2)
    raise TimeoutError("the picture never comes to rest")


def test_a_walk_opens_on_its_end_with_everything_in_sight(client, recordings):
    begun = time.monotonic()
    client.open(str(recordings / "walk.rrd"))
    while missing(client.take_screenshot()):
        assert time.monotonic() - begun < PATIENCE_S
    spent_s = time.monotonic() - begun
    assert missing(settled(client, "Plan"), within=PLAN) == []
    assert spent_s < OPENS_S
    state = client.get_state()
    (recording,) = state.recordings
    assert recording.current_timeline == "utc"
    (utc,) = [timeline for timeline in recording.timelines if timeline.name == "utc"]
    assert recording.current_time == utc.end
    assert [(view.name, view.reports) for view in state.views if view.reports] == []
    assert [entry.message for entry in client.get_logs() if entry.level == "ERROR"] == []


def test_the_region_shrinks(client, recordings):
    client.open(str(recordings / "walk.rrd"))
    late = settled(client, "Plan")
    client.set_time("elapsed", duration=80.0, play_state="paused")
    early = settled(client, "Plan")
    outline = [count(png, colours.POSTERIOR, within=PLAN, off=12) for png in (early, late)]
    assert outline[0] > 1.5 * outline[1] > 0, outline


def test_nothing_is_not_taken_for_a_walk(client, recordings):
    """The negative control: what is looked for cannot be seen where it was not drawn."""
    client.open(str(recordings / "empty.rrd"))
    time.sleep(2.0)
    assert len(missing(client.take_screenshot())) > 3
