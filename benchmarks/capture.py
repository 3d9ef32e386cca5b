"""Captures of a modem: processor time of their import beside SCAT's, and walks beside AT.

python benchmarks/capture.py rate [--mb 30] [--captures FOLDER] [--kinds NAME ...] [--no-scat]
python benchmarks/capture.py walks [--scene inside] [--walks 16] [--first 0]

`rate` imports, by the command, the log records of public captures one after another and over and
over, each time later: without messages (RRC and NAS), with them, and with them without pycrate; and
short records of levels alone. Times are those of the processor: of the command with all its
modules, beyond that of importing one second, and of SCAT with the same file. `walks` has errors and
95 % regions of simulated walks: by a capture, by AT each 3 s, and by AT as often as the capture has
readings.
"""

import argparse
import resource
import subprocess
import sys
from binascii import crc_hqx
from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from logger.drivers.diag.frames import REVERSED, escape, unescape
from postproc.interop.readers.diag import CODES
from tests.kit.capture_walks import SCENES, Pair, side_by_side
from tests.kit.diag_capture import (
    EARFCN,
    OTHER_PCI,
    PCI,
    T0_NS,
    log_packet,
    modem_time,
    neighbour_cells,
    serving_cell,
    stream,
)

CAPTURES = Path(__file__).resolve().parents[2] / "shared" / "captures"
"""Public captures; they are not part of the project."""
IMPORT = "import sys; from postproc.cli import main; sys.exit(main())"
WITHOUT_PYCRATE = f"import sys; sys.modules['pycrate_asn1dir'] = None; {IMPORT}"
SCAT = Path(sys.executable).with_name("scat")
_SECOND = modem_time(10**18 + 10**9) - modem_time(10**18)
_DAY = 86_400 * _SECOND


def packets(data: bytes) -> list[bytes]:
    """Log records of a stream, without their sum."""
    raw = map(unescape, data.split(b"\x7e"))
    return [one[:-2] for one in raw if len(one) > 26 and one[_at(one)] == 0x10]


def _at(packet: bytes) -> int:
    """Where the log record begins: behind the number of a receiver, if it has one."""
    return 8 if packet[0] == 0x98 else 0


def is_message(packet: bytes) -> bool:
    return int.from_bytes(packet[_at(packet) + 6 :][:2], "little") in CODES


def frames_of(once: Sequence[Sequence[bytes]], n_bytes: int) -> Iterator[bytes]:
    """Frames of captures one after another, on one clock that goes on, until they are so many."""
    clock = modem_time(1_790_028_000 * 10**9)
    while n_bytes > 0:
        for capture in once:
            times = [_time(packet) for packet in capture]
            begin = times[0]
            for packet, time in zip(capture, times, strict=True):
                # a modem whose clock is set while it records jumps by years
                passed = time - begin if 0 <= time - begin < _DAY else 0
                at = _at(packet) + 8
                data = frame(
                    packet[:at] + (clock + passed).to_bytes(8, "little") + packet[at + 8 :]
                )
                yield data
                n_bytes -= len(data)
                last = clock + passed
            clock = last + _SECOND


def short_records(a_second: int) -> list[bytes]:
    """The levels of a serving cell and of a neighbour, so many times a second for a minute."""
    records = []
    for i in range(60 * a_second):
        level_dbm, t_ns = -80.0 - i % 30, T0_NS + i * 10**9 // a_second
        own = serving_cell(EARFCN, PCI, level_dbm)
        other = neighbour_cells(EARFCN, [(OTHER_PCI, level_dbm)])
        for code, body in ((0xB17F, own), (0xB180, other)):
            records.append(log_packet(code, t_ns, body))
    return records


def _time(packet: bytes) -> int:
    return int.from_bytes(packet[_at(packet) + 8 :][:8], "little")


def frame(packet: bytes) -> bytes:
    """As it crosses a port; `diag_capture.frame` goes bit by bit."""
    crc = crc_hqx(packet.translate(REVERSED), 0xFFFF) ^ 0xFFFF
    return escape(packet + crc.to_bytes(2, "big").translate(REVERSED)) + b"\x7e"


def processor_s(command: Sequence[str | Path]) -> float:
    """User and system time of a command and of what it starts."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"{command}: {done.stderr}")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def import_s(source: Path, program: str = IMPORT) -> float:
    run = source.with_suffix(".h5")
    return processor_s([sys.executable, "-c", program, "import", source, "-o", run])


def print_rate(name: str, source: Path, start_s: float, program: str, with_scat: bool) -> None:
    n_mb, own_s = source.stat().st_size / 1e6, import_s(source, program)
    text = f"{name}: {n_mb:.1f} MB in {own_s:.1f} s, {n_mb / own_s:.2f} MB/s"
    text += f"; beyond the {start_s:.1f} s of one second, {n_mb / (own_s - start_s):.2f} MB/s"
    if with_scat:
        scat_s = processor_s([SCAT, "-t", "qc", "-d", source, "-F", source.with_suffix(".pcap")])
        text += (
            f"; SCAT {scat_s:.1f} s, {n_mb / scat_s:.2f} MB/s, {scat_s / own_s:.1f} times as long"
        )
    print(text, flush=True)


def rate(options: argparse.Namespace) -> None:
    """Print a line for each kind of capture."""
    files = sorted(options.captures.glob("*.mi2log")) + sorted(options.captures.glob("*.qmdl"))
    captures = [packets(file.read_bytes()) for file in files]
    levels = [[one for one in capture if not is_message(one)] for capture in captures]
    kinds = {
        "short records, 25 a second": ([short_records(25)], IMPORT),
        "short records, 3 a second": ([short_records(3)], IMPORT),
    }
    if captures:
        kinds |= {
            "without messages": ([one for one in levels if one], IMPORT),
            "with messages": (captures, IMPORT),
            "with messages, without pycrate": (captures, WITHOUT_PYCRATE),
        }
    with TemporaryDirectory() as folder:
        source = Path(folder) / "capture.qmdl"
        source.write_bytes(stream(range(1)))
        start_s = import_s(source)
        for name in options.kinds or kinds:
            once, program = kinds[name]
            with source.open("wb") as file:
                file.writelines(frames_of(once, round(options.mb * 1e6)))
            print_rate(name, source, start_s, program, options.scat and program == IMPORT)


def walks(options: argparse.Namespace) -> None:
    """Print each walk, then both ways and their differences."""
    pairs = []
    with TemporaryDirectory() as folder:
        for seed in range(options.first, options.first + options.walks):
            pairs.append(side_by_side(seed, Path(folder), options.scene, often=True))
            print(pairs[-1], flush=True)
    print(*summary(pairs), sep="\n")


def summary(pairs: Sequence[Pair]) -> Iterator[str]:
    """Lines on the walks together, and on their differences, walk by walk."""
    names = {"capture": "capture", "at": "AT", "at_often": "AT often"}
    for way, name in names.items():
        endings = [getattr(one, way) for one in pairs]
        error_m, covered, r95_m = np.array([one[:3] for one in endings]).T
        yield (
            f"{name:8} error: median {np.median(error_m):.0f} m, mean {np.mean(error_m):.0f} m; "
            f"95 % region: {np.sum(covered):.0f} of {len(pairs)} hold the cell, "
            f"median radius {np.median(r95_m):.0f} m; "
            f"{sum(one.verdict == 'located' for one in endings)} located"
        )
    for way, other in (("capture", "at"), ("capture", "at_often"), ("at_often", "at")):
        apart_m = np.array(
            [getattr(one, way).error_m - getattr(one, other).error_m for one in pairs]
        )
        sigma_m = np.std(apart_m, ddof=1) / np.sqrt(len(pairs)) if len(pairs) > 1 else np.nan
        yield (
            f"{names[way]} less {names[other]}: mean {np.mean(apart_m):+.1f} +- {sigma_m:.1f} m, "
            f"median {np.median(apart_m):+.1f} m; worse in {np.sum(apart_m > 0)}, "
            f"better in {np.sum(apart_m < 0)} of {len(pairs)}"
        )


def main() -> None:
    parser = argparse.ArgumentParser()
    commands = parser.add_subparsers(required=True)
    rates = commands.add_parser("rate")
    rates.add_argument("--mb", type=float, default=30.0)
    rates.add_argument("--captures", type=Path, default=CAPTURES)
    rates.add_argument("--kinds", nargs="+")
    rates.add_argument("--no-scat", dest="scat", action="store_false")
    rates.set_defaults(run=rate)
    both = commands.add_parser("walks")
    both.add_argument("--scene", choices=SCENES, default="inside")
    both.add_argument("--walks", type=int, default=16)
    both.add_argument("--first", type=int, default=0)
    both.set_defaults(run=walks)
    options = parser.parse_args()
    options.run(options)


if __name__ == "__main__":
    main()
