"""The native viewer without a screen, rendered by software Vulkan."""

import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rerun.experimental import ViewerClient

from postproc.view import viewer

DRIVER = next(Path("/usr/share/vulkan/icd.d").glob("lvp_icd*.json"), None)
MISSING = "software Vulkan is missing (Debian: apt-get install mesa-vulkan-drivers)"
TIMEOUT_S = 180.0


@contextmanager
def headless_viewer(folder: Path, *through: str) -> Iterator[ViewerClient]:
    """A viewer without a window, reachable from this machine only.

    It stores its settings and its log in `folder`. `through` is a command that runs the viewer's
    command, which follows as its arguments.
    """
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    program = viewer.binary()
    environment = viewer.offline_environment(program, folder) | {
        "VK_ICD_FILENAMES": str(DRIVER),
        "XDG_RUNTIME_DIR": str(folder),
    }
    command = [
        *through,
        str(program),
        "--headless",
        "--bind",
        "127.0.0.1",
        "--port",
        str(port),
        "--expect-data-soon",
    ]
    with (folder / "log").open("wb") as log, viewer.child(command, environment, log.fileno()):
        yield _connect(port)


def _connect(port: int) -> ViewerClient:
    until = time.monotonic() + TIMEOUT_S
    while time.monotonic() < until:
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
        time.sleep(0.05)
    raise TimeoutError("the viewer does not answer")


def stable_screenshot(client: ViewerClient, view: str) -> bytes:
    """A picture of one view after it has stopped changing; the first may be incomplete."""
    (view_id,) = [v.view_id for v in client.get_state().views if v.name == view]
    before, until = None, time.monotonic() + TIMEOUT_S
    while time.monotonic() < until:
        now = client.take_screenshot(view_id)
        if now == before:
            return now
        before = now
        time.sleep(0.2)
    raise TimeoutError("the picture never stops changing")
