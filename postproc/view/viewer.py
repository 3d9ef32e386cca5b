"""The rerun viewer as a program of its own, that listens on this machine only and ends with us."""

import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.resources import files
from pathlib import Path
from tempfile import TemporaryDirectory

from logger.core.errors import ConfigError

LOOPBACK = "127.0.0.1"
NOBODY = f"http://{LOOPBACK}:9"

_INSTEAD = "use --web, or --save RUN.rrd and `postproc view RUN.rrd` elsewhere"
_MISSING = "the viewer is missing: install cellwalk[view]"
_TILES = "tile.openstreetmap.org"
_GRACE_S = 5.0


def show(write: Callable[[Path], None], name: str) -> int:
    """Write a recording to a temporary file and show it until the window is closed; the exit code
    is 0.
    """
    _check_screen()
    viewer = binary()
    with TemporaryDirectory(prefix="cellwalk-") as folder:
        path, log = Path(folder) / f"{name}.rrd", Path(folder) / "viewer.log"
        write(path)
        with (
            log.open("wb") as told,
            child(command(viewer, path), discreet(viewer, Path(folder)), told.fileno()) as run,
        ):
            code = run.wait()
        if code:
            raise ConfigError(f"{_reason(code, log.read_text(errors='replace'))}: {_INSTEAD}")
    return 0


def _check_screen() -> None:
    """Raise `ConfigError` where no window can be opened; only Linux tells."""
    if sys.platform.startswith("linux") and not any(
        os.environ.get(v) for v in ("DISPLAY", "WAYLAND_DISPLAY")
    ):
        raise ConfigError(f"there is no screen to show it on: {_INSTEAD}")


def binary() -> Path:
    """The viewer itself: the `rerun` on the path is a script that would leave it behind when it is
    stopped.
    """
    try:
        folder = files("rerun_cli")
    except ImportError as error:
        raise ConfigError(_MISSING) from error
    candidates = [
        Path(str(folder)) / name
        for name in ("Rerun.app/Contents/MacOS/Rerun", "rerun.exe", "rerun")
    ]
    found = next((path for path in candidates if path.is_file()), None)
    if found is None:
        raise ConfigError(_MISSING)
    return found


def discreet(viewer: Path, folder: Path) -> dict[str, str]:
    """Environment in which the viewer asks the network for nothing but the map's tiles, once
    somebody looks at the map.

    No variable turns off its statistics (seen with rerun 0.41), its settings do: so it gets a
    folder of settings of its own, and the user's stay as they are; only Linux heeds that. It looks
    for a newer version of itself by whatever proxy is set, so that is one that nobody answers at.
    """
    environment = os.environ | {"XDG_CONFIG_HOME": str(folder / "settings")}
    for name, value in (("HTTPS_PROXY", NOBODY), ("NO_PROXY", _TILES)):
        environment |= {name: value, name.lower(): value}
    subprocess.run(  # noqa: S603
        [viewer, "analytics", "disable"], env=environment, check=False, capture_output=True
    )
    return environment


def command(viewer: Path, path: Path) -> list[str]:
    """A viewer of its own, whatever others are open, reachable from this machine only."""
    return [str(viewer), "--bind", LOOPBACK, "--port", "auto", str(path)]


@contextmanager
def child(
    command: Sequence[str], environment: Mapping[str, str], log: int
) -> Iterator[subprocess.Popen[bytes]]:
    """A program that is gone when this ends, also when we are told to terminate; it writes to the
    file `log`.
    """
    with terminated_as_interrupted():
        running = subprocess.Popen(  # noqa: S603
            command, env=environment, stdin=subprocess.DEVNULL, stdout=log, stderr=log
        )
        try:
            yield running
        finally:
            running.terminate()
            try:
                running.wait(_GRACE_S)
            except subprocess.TimeoutExpired:
                running.kill()
                running.wait()


@contextmanager
def terminated_as_interrupted() -> Iterator[None]:
    """SIGTERM raises `KeyboardInterrupt` meanwhile, so that what was begun is ended in order.

    SIGINT does so too where a shell that put us into the background had it ignored.
    """

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    before = {
        number: signal.signal(number, interrupt) for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _reason(code: int, log: str) -> str:
    """What ended the viewer, by its last words."""
    last = min((log.rpartition(mark)[2] for mark in ("Error: ", "panicked at ")), key=len)
    if re.search(r"graphics|adapter|gpu|vulkan", last, re.IGNORECASE):
        return "the viewer found no graphics that it can use"
    if re.search(r"x server|display|wayland", last, re.IGNORECASE):
        return "the viewer could not open the screen"
    return f"the viewer stopped with code {code}"
