"""The real service, in a process of its own, on real ptys."""

import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from logger.core.errors import RunFileError
from logger.core.runfile import read_run
from logger.sim.devices import sentence

LIMIT_S = 120.0
"""Limit for actions that take a second on an idle machine."""
FIELDLOGGER = (sys.executable, "-m", "logger.cli")


def site_toml(folder: Path, modem: str, gnss: str, more: str = "") -> Path:
    path = folder / "site.toml"
    path.write_text(
        f'[run]\ndirectory = "{folder / "runs"}"\n'
        f'[modem]\nport = "{modem}"\ndriver = "sim800"\npoll_interval_s = 0.05\n'
        f'[gnss]\nport = "{gnss}"\n{more}'
    )
    return path


@contextmanager
def running_service(config: Path, *more: str) -> Iterator[subprocess.Popen[str]]:
    """`fieldlogger run`, which does not outlive the test."""
    command = [*FIELDLOGGER, "run", "--config", str(config), *more]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            yield process
        finally:
            if process.poll() is None:
                process.kill()


def run_python(script: str) -> str:
    """Output of a script in a Python process of its own."""
    return subprocess.run(
        [sys.executable, "-c", script], check=True, capture_output=True, text=True
    ).stdout


def wait_at_most(process: subprocess.Popen[bytes], seconds: float) -> None:
    """Wait for the end of a process, at most for some seconds."""
    with suppress(subprocess.TimeoutExpired):
        process.wait(seconds)


def stop_service(process: subprocess.Popen[str], by: signal.Signals = signal.SIGTERM) -> str:
    """Stop the service as systemd would; returns what it printed."""
    process.send_signal(by)
    out, errors = process.communicate(timeout=LIMIT_S)
    assert process.returncode == 0, errors
    return out


@contextmanager
def systemd(monkeypatch: pytest.MonkeyPatch, folder: Path) -> Iterator[Callable[[], list[str]]]:
    """A $NOTIFY_SOCKET for the next service; yields a function that returns all assignments."""
    received: list[str] = []
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as server:
        server.bind(str(folder / "notify"))
        server.setblocking(False)
        monkeypatch.setenv("NOTIFY_SOCKET", str(folder / "notify"))

        def assignments() -> list[str]:
            with suppress(OSError):  # nothing more now
                while True:
                    received.extend(server.recv(4096).decode().splitlines())
            return received

        yield assignments


def assert_ends(work: Callable[[], object], seconds: float = LIMIT_S) -> None:
    """Run something that might block; AssertionError if it does not end in time."""
    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    thread.join(seconds)
    assert not thread.is_alive(), "did not end in time"


def wait_for(condition, seconds: float = LIMIT_S) -> None:
    """Poll until the condition holds; AssertionError when it does not in time."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "did not happen in time"
        time.sleep(0.02)


def n_recorded(folder: Path, table: str) -> int:
    """Rows of a table in the only journal of a folder, as far as they are on the card."""
    try:
        (journal,) = folder.glob("*.journal")
        return len(read_run(journal).tables[table])
    except (RunFileError, ValueError):
        return 0  # made, and not yet written for the first time


def journal_holds(folder: Path, sent: bytes) -> bool:
    """True if the only journal of a folder contains exactly these raw bytes."""
    try:
        (journal,) = folder.glob("*.journal")
        return read_run(journal).raw_bytes.tobytes() == sent
    except (RunFileError, ValueError):
        return False  # made, and not yet written for the first time


def nmea_epochs(n: int, rate_hz: float = 1.0) -> bytes:
    """NMEA of a walk to the east: RMC and GGA for each epoch, n of them."""
    out = []
    for i in range(n):
        t_s = i / rate_hz
        clock = f"{int(t_s // 3600) % 24:02d}{int(t_s // 60) % 60:02d}{t_s % 60:05.2f}"
        lon = f"013{24.0 + i * 0.001:08.5f}"
        out += [
            sentence(f"GNRMC,{clock},A,5231.00000,N,{lon},E,2.7,90.0,210926,,,A,V"),
            sentence(f"GNGGA,{clock},5231.00000,N,{lon},E,1,09,0.9,34.0,M,40.0,M,,"),
        ]
    return b"".join(out)


CENG = (
    b"\r\n+CENG: 1,1\r\n\r\n"
    b'+CENG: 0,"0017,45,00,262,01,09,3039,05,05,1267,255"\r\n'
    b'+CENG: 1,"0021,30,12,303a,262,01,1267"\r\n\r\nOK\r\n'
)
"""Two cells: 262-01-4711-12345 at -68 dBm and its neighbour at -83 dBm."""
