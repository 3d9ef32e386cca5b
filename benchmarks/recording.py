"""Cost of an hour of recording: bytes written to the card, processor time and memory.

python benchmarks/recording.py [HOURS]

The load is that of a fast receiver in a busy city: NMEA at 10 Hz, and a scan of 1 to 40 cells every
2 s as text and as readings, with the live estimate.
"""

import os
import random
import resource
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from logger.core.live import LiveTracker
from logger.core.live_settings import LiveSettings
from logger.core.runfile import RunMeta, RunWriter, finish_journal
from logger.core.types import CellReading, Fix, RawBytes, Record, Scan

PAGE_BYTES = 4096
UTC0_NS = 1_790_000_000 * 10**9
CELLS = [(4000 + i % 7, 20_000 + 37 * i, 10 + i) for i in range(60)]


def second(k: int, rng: random.Random) -> Iterator[Record]:
    """Records of one second of a walk."""
    for i in range(10):
        t_ns = k * 10**9 + i * 10**8
        lat, lon = 52.5 + 1.2e-5 * k + rng.gauss(0, 1e-6), 13.4 + 2e-5 * k + rng.gauss(0, 1e-6)
        place = f"{52:02d}{lat % 1 * 60:08.5f},N,{13:03d}{lon % 1 * 60:08.5f},E"
        clock = f"{k // 3600 % 24:02d}{k // 60 % 60:02d}{k % 60:02d}.{i}0"
        motion = f"{rng.uniform(2, 3):.3f},{rng.uniform(0, 360):.2f}"
        rmc = f"$GNRMC,{clock},A,{place},{motion},210926,,,A,V*5A\r\n"
        quality = f"1,{rng.randrange(7, 12):02d},0.9,{rng.gauss(34, 1):.1f}"
        gga = f"$GNGGA,{clock},{place},{quality},M,40.0,M,,*4C\r\n"
        yield Record(t_ns, "gnss", RawBytes((rmc + gga).encode()))
        yield Record(
            t_ns,
            "gnss",
            Fix(True, UTC0_NS + t_ns, lat, lon, rng.gauss(34, 1), hdop=0.9, sats_used=9),
        )
    if k % 2 == 0:
        yield from _scan(k * 10**9 + 950_000_000, rng)


def _scan(t_ns: int, rng: random.Random) -> Iterator[Record]:
    observed = rng.sample(CELLS, rng.randint(1, 40))
    levels = [rng.randrange(5, 60) for _ in observed]
    text = "".join(
        f'+CENG: {i},"{arfcn:04d},{level},00,262,01,{arfcn % 60},{cid:x},05,05,{lac},255"\r\n'
        for i, ((lac, cid, arfcn), level) in enumerate(zip(observed, levels, strict=True))
    )
    yield Record(t_ns, "modem", RawBytes(b"AT+CENG?\r\n", sent=True))
    yield Record(t_ns, "modem", RawBytes(text.encode()))
    readings = tuple(
        CellReading(
            "scan",
            "GSM",
            "262",
            "01",
            lac,
            cid,
            arfcn=arfcn,
            bsic=9,
            rxlev_raw=level,
            rssi_dbm=level - 110.0,
        )
        for (lac, cid, arfcn), level in zip(observed, levels, strict=True)
    )
    yield Record(t_ns, "modem", Scan(t_ns - 800_000_000, readings))


@contextmanager
def counted_pages() -> Iterator[Counter[str]]:
    """Count the pages that writes touch: a card writes complete pages, however few bytes are new.

    /proc/self/io counts a page once for several writes, so it does not measure what is flushed each
    second.
    """
    pages: Counter[str] = Counter()
    real = os.pwrite

    def pwrite(fd: int, data: bytes, offset: int) -> int:
        written = real(fd, data, offset)
        pages["written"] += (
            (offset + written - 1) // PAGE_BYTES - offset // PAGE_BYTES + 1 if written else 0
        )
        return written

    os.pwrite = pwrite
    try:
        yield pages
    finally:
        os.pwrite = real


def record(folder: Path, seconds: int, *, live: bool = True) -> Path:
    """Record so many seconds as the recorder does, one sync each; returns the journal."""
    rng = random.Random(1)
    meta = RunMeta(run_id="0", boot_id="0", started_ns=0, origin="benchmark", program="benchmark")
    writer = RunWriter(folder / "run-000001.journal", meta)
    tracker = LiveTracker(LiveSettings())
    for k in range(seconds):
        for found in second(k, rng):
            seq = writer.append(found)
            if live:
                for value in tracker.feed(seq, found):
                    writer.append(Record(found.t_ns, "live", value))
        writer.sync()
    writer.close(seconds * 10**9, "done")
    return writer.path


def main() -> None:
    """Print the costs of recording and of the making of the HDF5 file."""
    seconds = round(3600 * float(sys.argv[1] if len(sys.argv) > 1 else 1.0))
    for live in (False, True):
        with tempfile.TemporaryDirectory() as folder, counted_pages() as pages:
            begun, cpu = time.perf_counter(), time.process_time()
            journal = record(Path(folder), seconds, live=live)
            spent_s, cpu_s = time.perf_counter() - begun, time.process_time() - cpu
            card_mb = pages["written"] * PAGE_BYTES / 1e6
            begun = time.perf_counter()
            run = finish_journal(journal)
            peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
            print(
                f"{'with' if live else 'without'} live estimate: {card_mb * 3600 / seconds:.1f} "
                f"MB/h to the card, "
                f"journal {journal.stat().st_size * 3600 / seconds / 1e6:.1f} MB/h, "
                f"{cpu_s / seconds:.4f} s of processor a second ({spent_s:.0f} s in all); "
                f"HDF5 {run.stat().st_size * 3600 / seconds / 1e6:.1f} MB/h in "
                f"{time.perf_counter() - begun:.1f} s; "
                f"peak {peak_mb:.0f} MB",
                flush=True,
            )


if __name__ == "__main__":
    main()
