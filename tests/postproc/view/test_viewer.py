import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from logger.core.errors import ConfigError
from postproc.view import viewer
from postproc.view.viewer import show

FAKE = """#!/bin/sh
echo "$XDG_CONFIG_HOME $*" >> {folder}/calls
[ "$1" = analytics ] && exit 0
for last; do :; done
test -s "$last" || exit 3
{then}
"""


def fake(folder, then):
    """A stand-in that writes down how it was called, and whether the recording was there."""
    program = folder / "rerun"
    program.write_text(FAKE.format(folder=folder, then=then))
    program.chmod(0o755)
    return program


def write(path):
    path.write_text("a recording")


@pytest.fixture
def screen(monkeypatch):
    monkeypatch.setenv("DISPLAY", ":0")


def test_a_missing_screen_is_an_error_with_alternatives(monkeypatch):
    monkeypatch.setattr("sys.platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(ConfigError, match="no screen.*--web.*--save"):
        show(write, "run")


def test_it_runs_in_the_foreground_and_listens_here_only(screen, monkeypatch, tmp_path):
    monkeypatch.setattr(viewer, "binary", lambda: fake(tmp_path, "exit 0"))
    assert show(write, "run") == 0
    settings, opened = (tmp_path / "calls").read_text().splitlines()
    assert settings.endswith(" analytics disable")
    assert "--bind 127.0.0.1" in opened
    assert settings.split()[0] == opened.split()[0] != os.environ.get("XDG_CONFIG_HOME")
    assert not os.path.exists(opened.split()[-1])


NO_GRAPHICS = (
    "echo 'panicked at main: No graphics adapter was found' >&2; exit 102",
    "echo 'Error: app creation: The GPU driver is lacking some abilities' >&2; exit 1",
)
NO_SCREEN = (
    "echo 'Error: Failed to open connection to X server' >&2; exit 1",
    "echo 'WARN no GPU'; echo 'Error: neither WAYLAND_DISPLAY nor DISPLAY is set' >&2; exit 1",
)


@pytest.mark.parametrize(
    ("then", "why"),
    [
        *((script, "no usable graphics") for script in NO_GRAPHICS),
        *((script, "could not open the screen") for script in NO_SCREEN),
        ("exit 7", "code 7"),
    ],
)
def test_a_failure_of_the_viewer_is_one_line(then, why, screen, monkeypatch, tmp_path, capfd):
    monkeypatch.setattr(viewer, "binary", lambda: fake(tmp_path, then))
    with pytest.raises(ConfigError, match=f"{why}.*--web"):
        show(write, "run")
    assert capfd.readouterr() == ("", "")


# a process that a shell started in the background ignores SIGINT, and so would all its children
PROGRAM = """
import signal
import sys
from pathlib import Path
from postproc.view import viewer
signal.signal(signal.SIGINT, signal.default_int_handler)
viewer.binary = lambda: Path(sys.argv[1])
viewer.show(lambda path: path.write_text("a recording"), "run")
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_no_viewer_is_left_behind(number, tmp_path):
    program = fake(tmp_path, f"echo $$ > {tmp_path}/pid; exec sleep 60")
    environment = os.environ | {"DISPLAY": ":0"}
    running = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, program], env=environment, stderr=subprocess.DEVNULL
    )
    pid = tmp_path / "pid"
    until = time.monotonic() + 60
    while not (pid.exists() and pid.read_text().strip()):
        assert time.monotonic() < until
        time.sleep(0.02)
    running.send_signal(number)
    assert running.wait(60) != 0
    while Path(f"/proc/{pid.read_text().strip()}").exists():
        assert time.monotonic() < until
        time.sleep(0.02)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_the_viewer_starts_leaves_none_behind(number, tmp_path, monkeypatch):
    """The signal comes when the process exists and its parent does not know it yet."""
    started, start = [], subprocess.Popen

    def start_and_signal(*arguments, **options):
        started.append(start(*arguments, **options))
        os.kill(os.getpid(), number)
        return started[0]

    monkeypatch.setattr(subprocess, "Popen", start_and_signal)
    with (tmp_path / "log").open("wb") as log, pytest.raises(KeyboardInterrupt):
        with viewer.child(["sleep", "60"], os.environ, log.fileno()):
            pytest.fail("the signal was lost")
    assert started[0].poll() is not None


def test_the_real_viewer_is_found():
    assert viewer.binary().is_file()
