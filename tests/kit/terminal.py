"""The output of a program on a real terminal."""

import fcntl
import os
import pty
import re
import select
import struct
import subprocess
import sys
import termios
import time

COLOUR = re.compile(r"\x1b\[(?:\d+;)*(?:3[0-8]|4[0-8]|9\d|10\d)(?:;\d+)*m")
"""Escape sequences that choose a colour; bold and dim are none (no-color.org)."""


def on_terminal(
    *command: str, typed: str = "", timeout_s: float = 180.0, columns: int = 120, **environment: str
) -> tuple[str, int]:
    """Run a command on a pty and type a text; return the output and the exit code."""
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 40, columns, 0, 0))
    inherited = {
        k: v
        for k, v in os.environ.items()
        if k not in {"NO_COLOR", "FORCE_COLOR", "COLUMNS", "LINES"}
    }
    program = subprocess.Popen(
        command, stdin=theirs, stdout=theirs, stderr=theirs, close_fds=True, start_new_session=True,
        env=inherited | {"TERM": "xterm-256color"} | environment,
    )  # fmt: skip
    os.close(theirs)
    try:
        os.write(ours, typed.encode())
        shown = _read_all(ours, time.monotonic() + timeout_s)
        return shown, program.wait(timeout=60.0)
    finally:
        program.kill()
        program.wait()
        os.close(ours)


def postproc(*arguments: str, columns: int = 120, **environment: str) -> tuple[str, int]:
    """The command on a terminal."""
    return on_terminal(
        sys.executable, "-m", "postproc.cli", *arguments, columns=columns, **environment
    )


def _read_all(ours: int, until_s: float) -> str:
    shown = b""
    while time.monotonic() < until_s:
        ready, _, _ = select.select([ours], [], [], 0.2)
        try:
            part = os.read(ours, 65536) if ready else None
        except OSError:  # the other side is closed: the program has ended
            break
        if part == b"":
            break
        shown += part or b""
    return shown.decode("utf-8", "replace")
