"""Does the page disturb the recording? Ten phones, a slow one, and 10 000 requests a minute.

Real service, real page, simulated walk behind real ptys, in real time. Prints for both halves,
without and with the phones, the longest gaps between fixes as recorded and the processor time of
the recorder; then the answers to the flood and the memory of the page.
"""

import argparse
import os
import socket
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from logger.core.runfile import read_run
from tests.kit import page as kit
from tests.kit import service
from tests.kit.simulated_devices import simulated_devices

PHONES = 10
FLOOD_PER_S = 10_000 / 60
TICK_S = 1.0 / os.sysconf("SC_CLK_TCK")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0, help="of each half")
    half_s = parser.parse_args().seconds
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        status = kit.folders(folder)
        os.environ["RUNTIME_DIRECTORY"] = str(status)
        for is_disturbed in (False, True):
            print("with phones and flood:" if is_disturbed else "page off:", flush=True)
            _record(folder, half_s, is_disturbed=is_disturbed)


def _record(folder: Path, half_s: float, *, is_disturbed: bool) -> None:
    port = kit.free_port()
    listen = f'[page]\nlisten = "127.0.0.1:{port}"\n' if is_disturbed else ""
    with ExitStack() as stack:
        modem, gnss, _ = stack.enter_context(simulated_devices(rate=1.0))
        config = service.site_toml(folder, modem.path, gnss.path, listen)
        text = config.read_text().replace("poll_interval_s = 0.05", "poll_interval_s = 2.0")
        config.write_text(text)
        logger = stack.enter_context(service.running_service(config))
        time.sleep(10.0)  # imports
        used_s, start_s = _cpu_s(logger.pid), time.monotonic()
        if is_disturbed:
            page = stack.enter_context(kit.page_server(folder, config, port))
            _disturb(page, half_s)
        else:
            time.sleep(half_s)
        share = (_cpu_s(logger.pid) - used_s) / (time.monotonic() - start_s)
        service.stop_service(logger)
    _print_gaps(max((folder / "runs").glob("*.h5")))
    print(f"  recorder: {100 * share:.1f} % of a core")


def _disturb(page: kit.PageServer, half_s: float) -> None:
    used_s, codes, ended = _cpu_s(page.process.pid), Counter[int](), threading.Event()
    threads = [threading.Thread(target=_flood, args=(page, codes, ended))]
    with ExitStack() as stack:
        phones = [stack.enter_context(_phone(page, i)) for i in range(PHONES)]
        slow, *fast = phones  # the first one reads nothing
        threads += [threading.Thread(target=_read, args=(phone, ended)) for phone in fast]
        for thread in threads:
            thread.start()
        time.sleep(half_s)
        ended.set()
        for thread in threads:
            thread.join()
        slow.close()
    share = (_cpu_s(page.process.pid) - used_s) / half_s
    print(f"  answers to the flood: {dict(codes)}")
    print(f"  page: {100 * share:.1f} % of a core, {page.memory_kb / 1000:.0f} MB at most")


@contextmanager
def _phone(page: kit.PageServer, number: int) -> Iterator[socket.socket]:
    with socket.socket() as phone:
        phone.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        phone.bind((f"127.0.0.{number + 10}", 0))
        phone.connect(("127.0.0.1", page.port))
        phone.settimeout(1.0)
        phone.sendall(f"GET /{page.token}/live HTTP/1.1\r\nHost: {page.host}\r\n\r\n".encode())
        yield phone


def _read(phone: socket.socket, ended: threading.Event) -> None:
    while not ended.is_set():
        try:
            if not phone.recv(65536):
                return
        except TimeoutError:
            pass


def _flood(page: kit.PageServer, codes: Counter[int], ended: threading.Event) -> None:
    next_s = time.monotonic()
    while not ended.is_set():
        next_s += 1.0 / FLOOD_PER_S
        try:
            codes[page.request("track", source="127.0.0.200")[0]] += 1
        except OSError:
            codes[0] += 1
        time.sleep(max(0.0, next_s - time.monotonic()))


def _cpu_s(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) * TICK_S


def _print_gaps(path: Path) -> None:
    run = read_run(path)
    gaps_s = np.sort(np.diff(run.tables["fixes"]["t_ns"])) / 1e9
    longest = ", ".join(f"{gap:.3f}" for gap in gaps_s[-3:])
    notes = Counter(run.tables["notes"]["code"].tolist())
    lost = notes[b"overflow"] + notes[b"estimate-behind"]
    print(f"  {len(gaps_s) + 1} fixes, longest gaps {longest} s; {lost} losses noted")


if __name__ == "__main__":
    main()
