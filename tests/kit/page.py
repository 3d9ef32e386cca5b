"""The real page server beside a status folder, in a process of its own."""

import os
import socket
import subprocess
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from http.client import HTTPConnection
from pathlib import Path

import msgspec

from logger.core.types import Note
from logger.device.page_requests import PageRequests
from logger.device.status import Status, write_status
from tests.kit import service
from tests.kit.simulated_devices import simulated_devices


class PageServer:
    """A running server and its answers."""

    def __init__(self, folder: Path, process: subprocess.Popen[bytes], port: int) -> None:
        self.process, self.port = process, port
        self.host = f"127.0.0.1:{port}"
        self.requests = folder / "cellwalk-page" / "requests"
        self.token = (folder / "state" / "token").read_text()
        self.address = f"http://{self.host}/{self.token}/"

    def request(self, path, method="GET", body=None, source="127.0.0.1", **headers):
        """Status, headers and content; `path` after the token where it has no slash in front."""
        connection = HTTPConnection("127.0.0.1", self.port, timeout=20, source_address=(source, 0))
        target = path if path.startswith("/") else f"/{self.token}/{path}"
        connection.request(method, target, body, {"Host": self.host} | headers)
        response = connection.getresponse()
        result = response.status, dict(response.getheaders()), response.read()
        connection.close()
        return result

    def post(self, what, text: str, **headers):
        """Ask as the page does."""
        known = {"Content-Type": "application/json", "Origin": f"http://{self.host}"}
        body = f'"{text}"'.encode()
        return self.request(what, "POST", body, **{**known, **headers})

    @property
    def memory_kb(self) -> int:
        """Resident memory, the largest so far."""
        status = Path(f"/proc/{self.process.pid}/status").read_text()
        return int(status.split("VmHWM:")[1].split()[0])


def free_port() -> int:
    """A port that nobody listens at now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def folders(folder: Path) -> Path:
    """The folders that systemd would make; returns that of status.json."""
    for name in ("cellwalk", "cellwalk-page", "state", "runs"):
        (folder / name).mkdir(exist_ok=True)
    return folder / "cellwalk"


@contextmanager
def page_server(
    folder: Path, config: Path, port: int, program: Sequence[str] = ()
) -> Iterator[PageServer]:
    """`fieldlogger page` on a configuration that names the port; all it prints is in page.log."""
    environ = os.environ | {
        "RUNTIME_DIRECTORY": str(folder / "cellwalk-page"),
        "STATE_DIRECTORY": str(folder / "state"),
    }
    command = [*(program or (*service.FIELDLOGGER, "page")), "--config", str(config)]
    log = folder / "page.log"
    with (
        log.open("wb") as output,
        subprocess.Popen(command, env=environ, stdout=output, stderr=output) as process,
    ):
        try:
            service.wait_for(lambda: "the page is on" in log.read_text() or process.poll())
            yield PageServer(folder, process, port)
        finally:
            process.terminate()
            process.wait(20)


@contextmanager
def recording(folder: Path, status: Status) -> Iterator[list[Note]]:
    """What a recorder does for the page: it takes requests, and names them in its status.

    Yields the notes that it has taken.
    """
    requests, notes, ended = PageRequests(folder / "cellwalk-page"), [], threading.Event()

    def run() -> None:
        while not ended.wait(0.05):
            notes.extend(requests.take())
            requests.confirm(len(notes))
            now = msgspec.structs.replace(status, recorded=requests.on_card)
            write_status(folder / "cellwalk", now)

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield notes
    finally:
        ended.set()
        thread.join()


@contextmanager
def recorded_page(folder: Path, monkeypatch, rate=20.0, ground="") -> Iterator[tuple]:
    """The real service on a simulated walk and the page beside it.

    Yields the page and a function that starts the service, once more after it was stopped.
    """
    status, port = folders(folder), free_port()
    monkeypatch.setenv("RUNTIME_DIRECTORY", str(status))
    with simulated_devices(rate=rate) as (modem, gnss, _):
        table = f'[page]\nlisten = "127.0.0.1:{port}"\nmap = "{ground}"\n'
        table += '[live]\nmax_fix_age_s = 100.0\ntarget = "strongest"\n'
        config = service.site_toml(folder, modem.path, gnss.path, table)
        with page_server(folder, config, port) as page:
            yield page, lambda: service.running_service(config)
