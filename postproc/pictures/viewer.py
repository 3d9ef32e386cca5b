"""The rerun viewer as a program of its own, that listens on this machine only."""

import os
import subprocess
import sys
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from tempfile import TemporaryDirectory

from logger.core.errors import ConfigError

_NO_SCREEN = "there is no screen to show it on: use --save RUN.rrd and open that where there is one"
_MISSING = "the viewer is missing: install cellwalk[post]"


def show(write: Callable[[Path], None], name: str) -> int:
    """Write a recording to a temporary file and show it until the window is closed; the exit code is 0."""
    if not has_screen():
        raise ConfigError(_NO_SCREEN)
    viewer = binary()
    with TemporaryDirectory(prefix="cellwalk-") as folder:
        path = Path(folder) / f"{name}.rrd"
        write(path)
        code = subprocess.call(command(viewer, path), env=_discreet(viewer, Path(folder)))  # noqa: S603 - its own binary
    if code:
        raise ConfigError(f"the rerun viewer stopped with code {code} (no graphics?): use --save RUN.rrd instead")
    return 0


def has_screen() -> bool:
    """Whether windows can be opened; only Linux tells."""
    return not sys.platform.startswith("linux") or any(os.environ.get(v) for v in ("DISPLAY", "WAYLAND_DISPLAY"))


def binary() -> Path:
    """The viewer itself: the `rerun` on the path is a script that would leave it behind when it is stopped."""
    try:
        folder = files("rerun_cli")
    except ImportError as error:
        raise ConfigError(_MISSING) from error
    candidates = [Path(str(folder)) / name for name in ("Rerun.app/Contents/MacOS/Rerun", "rerun.exe", "rerun")]
    found = next((path for path in candidates if path.is_file()), None)
    if found is None:
        raise ConfigError(_MISSING)
    return found


def _discreet(viewer: Path, folder: Path) -> dict[str, str]:
    """Environment in which the viewer sends no usage statistics.

    No variable turns them off (seen with rerun 0.41), its settings do: so it gets a folder of settings of its own, and
    the user's stay as they are. Only Linux heeds the variable.
    """
    environment = os.environ | {"XDG_CONFIG_HOME": str(folder / "settings")}
    subprocess.run([viewer, "analytics", "disable"], env=environment, check=False, capture_output=True)  # noqa: S603
    return environment


def command(viewer: Path, path: Path) -> list[str]:
    """A viewer of its own, whatever others are open, reachable from this machine only."""
    return [str(viewer), "--bind", "127.0.0.1", "--port", "auto", str(path)]
