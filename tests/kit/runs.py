"""Small runs for tests, made with the real writer."""

from dataclasses import replace
from pathlib import Path

from logger.core.runfile import RunMeta, RunWriter
from logger.core.types import CellReading, Fix, Note, RawBytes, Record, Scan, Value

UTC0_NS = 1_790_000_000 * 10**9


def meta(**changes) -> RunMeta:
    return RunMeta(
        **{
            "run_id": "0" * 32,
            "boot_id": "12345678-boot",
            "started_ns": 0,
            "origin": "test",
            "program": "cellwalk test",
        }
        | changes
    )


def reading(cid: int, rssi_dbm: float, role="serving") -> CellReading:
    return CellReading(role, "GSM", "262", "01", 4711, cid, arfcn=17, bsic=9, rssi_dbm=rssi_dbm)


def records(n: int) -> list[Record]:
    """A walk of n seconds to the east.

    Each second has a fix, raw bytes and a scan of two cells, every tenth a note.
    """
    out = []
    for i in range(n):
        t_ns = i * 10**9
        out += [
            Record(t_ns, "gnss", RawBytes(f"$GPGGA,{i}\r\n".encode())),
            Record(
                t_ns,
                "gnss",
                Fix(True, UTC0_NS + t_ns, 52.0, 13.0 + i * 2e-5, 34.5, hdop=0.9, sats_used=8),
            ),
            Record(
                t_ns + 5,
                "modem",
                Scan(t_ns, (reading(1, -60.0 - i % 7), reading(2, -70.0, "neighbour")), None),
            ),
        ]
        if i % 10 == 0:
            out.append(Record(t_ns + 6, "logger", Note("info", "tick", f"second {i}, Grüße")))
    return out


def on_another_day(stream: list[Record], days: int = 1) -> list[Record]:
    """The same walk again: two files of one walk count once."""

    def later(value: Value) -> Value:
        if not isinstance(value, Fix) or value.utc_ns is None:
            return value
        return replace(value, utc_ns=value.utc_ns + days * 86_400 * 10**9)

    return [replace(record, value=later(record.value)) for record in stream]


def write_journal(
    path: Path, stream: list[Record], *, sync_every: int = 20, close: bool = True, **changes
) -> None:
    writer = RunWriter(path, meta(**changes))
    for i, record in enumerate(stream, 1):
        writer.append(record)
        if i % sync_every == 0:
            writer.sync()
    if close:
        writer.close(stream[-1].t_ns if stream else 0, "test")
    else:
        writer.sync()
