"""The rerun viewer as a child process that listens on this machine only and ends with us."""

import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.resources import files
from pathlib import Path
from shutil import copyfile
from tempfile import TemporaryDirectory

from logger.core.errors import ConfigError, RunFileError
from logger.core.foreign import open_regular

LOOPBACK = "127.0.0.1"
DEAD_PROXY = f"http://{LOOPBACK}:9"
"""The discard port: nothing answers there."""

_ALTERNATIVE = "use --web, or --save RUN.rrd and `postproc view RUN.rrd` on another machine"
_MISSING = "the viewer is missing: install cellwalk[view]"
_TILE_SERVER = "tile.openstreetmap.org"
_GRACE_S = 5.0
"""A viewer that has not ended after this is killed."""


def show(write: Callable[[Path], object], name: str) -> int:
    """Write a recording to a temporary file and show it until the window is closed.

    Returns the exit code 0; raises `ConfigError`.
    """
    _check_screen()
    viewer = binary()
    with TemporaryDirectory(prefix="cellwalk-") as folder:
        path, log_path = Path(folder) / f"{name}.rrd", Path(folder) / "viewer.log"
        write(path)
        environment = offline_environment(viewer, Path(folder))
        with (
            log_path.open("wb") as log,
            child(command(viewer, path), environment, log.fileno()) as process,
        ):
            code = process.wait()
        if code:
            reason = _failure(code, log_path.read_text(errors="replace"))
            raise ConfigError(f"{reason}: {_ALTERNATIVE}")
    return 0


def _check_screen() -> None:
    """Raise `ConfigError` where no window can be opened; only Linux shows that in advance."""
    screens = ("DISPLAY", "WAYLAND_DISPLAY")
    if sys.platform.startswith("linux") and not any(map(os.environ.get, screens)):
        raise ConfigError(f"there is no screen: {_ALTERNATIVE}")


def binary() -> Path:
    """The viewer's own executable; raises `ConfigError`.

    The `rerun` on the path is a script that would leave the viewer running when it is stopped.
    """
    try:
        folder = Path(str(files("rerun_cli")))
    except ImportError as error:
        raise ConfigError(_MISSING) from error
    for name in ("Rerun.app/Contents/MacOS/Rerun", "rerun.exe", "rerun"):
        if (folder / name).is_file():
            return folder / name
    raise ConfigError(_MISSING)


def offline_environment(viewer: Path, folder: Path) -> dict[str, str]:
    """Environment in which the viewer requests nothing but map tiles, once the map is shown.

    Usage statistics are turned off in the viewer's settings, since no variable does so (rerun
    0.41): the viewer gets its own folder of settings, and the user's stay as they are. Only Linux
    respects that folder. The check for a newer version goes through the proxy that is set, and so
    reaches nothing.
    """
    environment = os.environ | {"XDG_CONFIG_HOME": str(folder / "settings")}
    for name, value in (("HTTPS_PROXY", DEAD_PROXY), ("NO_PROXY", _TILE_SERVER)):
        environment |= {name: value, name.lower(): value}
    subprocess.run(  # noqa: S603
        [viewer, "analytics", "disable"], env=environment, check=False, capture_output=True
    )
    return environment


def command(viewer: Path, path: Path) -> list[str]:
    """A new viewer, whatever others are open, reachable from this machine only."""
    return [str(viewer), "--bind", LOOPBACK, "--port", "auto", str(path)]


@contextmanager
def child(
    command: Sequence[str], environment: Mapping[str, str], log: int
) -> Iterator[subprocess.Popen[bytes]]:
    """A child process that ends with this context, also on SIGTERM; its output goes to `log`."""
    with terminate_as_interrupt() as interrupt:
        interrupt.is_held = True  # else one that comes now would leave a child that nobody knows
        process = subprocess.Popen(  # noqa: S603
            command, env=environment, stdin=subprocess.DEVNULL, stdout=log, stderr=log
        )
        try:
            interrupt.release()
            yield process
        finally:
            interrupt.is_held = True
            process.terminate()
            try:
                process.wait(_GRACE_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


class Interrupt:
    """A signal handler that raises `KeyboardInterrupt`, or waits with it while `is_held`."""

    def __init__(self) -> None:
        self.is_held = False
        self._is_waiting = False

    def __call__(self, *_: object) -> None:
        if not self.is_held:
            raise KeyboardInterrupt
        self._is_waiting = True

    def release(self) -> None:
        """Raise from now on, and at once where a signal has come in the meantime."""
        self.is_held = False
        if self._is_waiting:
            raise KeyboardInterrupt


@contextmanager
def terminate_as_interrupt() -> Iterator[Interrupt]:
    """Let SIGTERM raise `KeyboardInterrupt`, so that contexts are closed in order.

    SIGINT does so, too, even if a shell that put us into the background ignores it.
    """
    interrupt = Interrupt()
    previous = {
        number: signal.signal(number, interrupt) for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        yield interrupt
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)


def _failure(code: int, log: str) -> str:
    """Why the viewer ended, by the last error in its log."""
    error = min((log.rpartition(mark)[2] for mark in ("Error: ", "panicked at ")), key=len)
    if re.search(r"graphics|adapter|gpu|vulkan", error, re.IGNORECASE):
        return "the viewer found no usable graphics adapter"
    if re.search(r"x server|display|wayland", error, re.IGNORECASE):
        return "the viewer could not open the screen"
    return f"the viewer stopped with code {code}"


_MAGIC = b"RRF"
"""Every rerun recording starts with it; its version follows."""


def is_recording(path: Path) -> bool:
    """Whether a file has the name of a recording."""
    return path.suffix.lower() == ".rrd"


def copy_recording(paths: Sequence[Path]) -> Callable[[Path], None]:
    """A function that copies the one recording to where a viewer reads it.

    Raises `ConfigError` or `RunFileError`.
    """
    if len(paths) > 1:
        raise ConfigError("give one recording (.rrd) alone, or runs")
    (source,) = paths
    try:
        with open_regular(source) as file:
            magic = file.read(len(_MAGIC))
    except OSError as error:
        raise RunFileError(f"{source}: {error.strerror}") from error
    if magic != _MAGIC:
        raise RunFileError(f"{source} is not a rerun recording")
    return lambda target: _copy(source, target)


def _copy(source: Path, target: Path) -> None:
    try:
        copyfile(source, target)
    except OSError as error:
        raise RunFileError(f"{source} cannot be shown: {error.strerror}") from error
