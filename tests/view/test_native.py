"""The recording in the native viewer, drawn by a processor: software Vulkan, no screen."""

import re
import shutil
import time

import pytest

from postproc.pictures import colours
from postproc.view import viewer
from postproc.view.scene import write_scene
from tests.kit import headless_viewer
from tests.kit import sample_results as kit
from tests.kit.headless_viewer import PATIENCE_S, stable_screenshot
from tests.kit.sample_view import sample_view
from tests.kit.screenshots import count_pixels, missing_items

pytestmark = pytest.mark.slow

PLAN = (0.0, 0.8)
"""Of the plan's width; farther east is the key."""


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """A walk, and the same before anything was heard."""
    folder = tmp_path_factory.mktemp("native")
    found = kit.sample_result(kit.write_run(folder / "walk.journal", seconds=240, cells=4))
    write_scene(sample_view(found), folder / "walk.rrd", online=False)
    nothing = kit.write_run(folder / "empty.journal", seconds=0, cells=1)
    write_scene(
        sample_view(kit.Result((kit.ObservedRun(nothing, None, ()),), ())),
        folder / "empty.rrd",
        online=False,
    )
    return folder


@pytest.fixture
def client(tmp_path):
    if headless_viewer.DRIVER is None:
        pytest.skip(headless_viewer.MISSING)
    with headless_viewer.headless_viewer(tmp_path) as found:
        yield found


def test_a_walk_opens_on_its_end_with_everything_in_sight(client, recordings):
    begun = time.monotonic()
    client.open(str(recordings / "walk.rrd"))
    while missing_items(client.take_screenshot()):
        assert time.monotonic() - begun < PATIENCE_S
    assert missing_items(stable_screenshot(client, "Plan"), within=PLAN) == []
    state = client.get_state()
    (recording,) = state.recordings
    assert recording.current_timeline == "utc"
    (utc,) = [timeline for timeline in recording.timelines if timeline.name == "utc"]
    assert recording.current_time == utc.end
    assert [(view.name, view.reports) for view in state.views if view.reports] == []
    assert [entry.message for entry in client.get_logs() if entry.level == "ERROR"] == []


def test_the_region_shrinks(client, recordings):
    client.open(str(recordings / "walk.rrd"))
    late = stable_screenshot(client, "Plan")
    client.set_time("elapsed", duration=80.0, play_state="paused")
    early = stable_screenshot(client, "Plan")
    outline = [count_pixels(png, colours.POSTERIOR, within=PLAN, off=12) for png in (early, late)]
    assert outline[0] > 1.5 * outline[1] > 0, outline


def test_nothing_is_not_taken_for_a_walk(client, recordings):
    """The negative control: what is looked for cannot be seen where it was not drawn."""
    client.open(str(recordings / "empty.rrd"))
    time.sleep(2.0)
    assert len(missing_items(client.take_screenshot())) > 3


def foreign(trace):
    """Lines of a trace of system calls that speak to another machine, or ask for its address."""
    spoken = [
        line
        for line in trace.read_text(errors="replace").splitlines()
        if "AF_INET" in line or "github" in line
    ]
    return [
        line
        for line in spoken
        if "github" in line or not re.search(r'"(127\.|::1|::ffff:127\.)', line)
    ]


@pytest.mark.parametrize("discreet", [True, False])
def test_nothing_leaves_the_machine_and_it_would_be_noticed(
    tmp_path, recordings, monkeypatch, discreet
):
    if headless_viewer.DRIVER is None or not shutil.which("strace"):
        pytest.skip(
            "software Vulkan or strace is missing (Debian: apt-get install mesa-vulkan-drivers strace)"
        )
    if not discreet:
        monkeypatch.setattr(viewer, "NOBODY", "")
    trace = tmp_path / "trace"
    calls = "trace=connect,sendto,sendmsg,sendmmsg"
    with headless_viewer.headless_viewer(
        tmp_path, "strace", "-D", "-f", "-s", "99", "-e", calls, "-o", str(trace)
    ) as client:
        client.open(str(recordings / "walk.rrd"))
        stable_screenshot(client, "Plan")
    assert bool(foreign(trace)) != discreet, foreign(trace)
