"""The recording in the native viewer, on software Vulkan and without a screen."""

import re
import shutil
import time

import pytest

from postproc.pictures import colours
from postproc.view import viewer
from postproc.view.scene import write_scene
from tests.kit import headless_viewer
from tests.kit import sample_results as kit
from tests.kit.headless_viewer import TIMEOUT_S, stable_screenshot
from tests.kit.sample_view import sample_view
from tests.kit.screenshots import count_pixels, missing_items

pytestmark = pytest.mark.slow

PLAN = (0.0, 0.8)
"""Of the plan's width; farther east is the key."""


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """A walk, and a run without records."""
    folder = tmp_path_factory.mktemp("native")
    result = kit.sample_result(kit.write_run(folder / "walk.journal", seconds=240, cells=4))
    write_scene(sample_view(result), folder / "walk.rrd", online=False)
    empty = kit.write_run(folder / "empty.journal", seconds=0, cells=1)
    write_scene(
        sample_view(kit.Result((kit.ObservedRun(empty, None, ()),), ())),
        folder / "empty.rrd",
        online=False,
    )
    return folder


@pytest.fixture
def client(tmp_path):
    if headless_viewer.DRIVER is None:
        pytest.skip(headless_viewer.MISSING)
    with headless_viewer.headless_viewer(tmp_path) as viewer_client:
        yield viewer_client


def test_a_walk_opens_at_its_end_with_everything_visible(client, recordings):
    start_s = time.monotonic()
    client.open(str(recordings / "walk.rrd"))
    while missing_items(client.take_screenshot()):
        assert time.monotonic() - start_s < TIMEOUT_S
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


def test_an_empty_run_shows_no_walk(client, recordings):
    """The negative control: what the tests look for is missing where it is not drawn."""
    client.open(str(recordings / "empty.rrd"))
    time.sleep(2.0)
    assert len(missing_items(client.take_screenshot())) > 3


def external_calls(trace):
    """System calls in a trace that address another machine, or look up its address."""
    loopback = re.compile(r'"(127\.|::1|::ffff:127\.)')
    return [
        line
        for line in trace.read_text(errors="replace").splitlines()
        if "github" in line or ("AF_INET" in line and not loopback.search(line))
    ]


@pytest.mark.parametrize("has_dead_proxy", [True, False])
def test_the_viewer_calls_no_other_machine(tmp_path, recordings, monkeypatch, has_dead_proxy):
    """Without the dead proxy, the negative control, the same trace shows its calls."""
    if headless_viewer.DRIVER is None or not shutil.which("strace"):
        packages = "mesa-vulkan-drivers strace"
        pytest.skip(f"software Vulkan or strace is missing (Debian: apt-get install {packages})")
    if not has_dead_proxy:
        monkeypatch.setattr(viewer, "DEAD_PROXY", "")
    trace = tmp_path / "trace"
    calls = "trace=connect,sendto,sendmsg,sendmmsg"
    with headless_viewer.headless_viewer(
        tmp_path, "strace", "-D", "-f", "-s", "99", "-e", calls, "-o", str(trace)
    ) as client:
        client.open(str(recordings / "walk.rrd"))
        stable_screenshot(client, "Plan")
    calls = external_calls(trace)
    assert bool(calls) != has_dead_proxy, calls
