"""Through which files a reading passes, from the bytes of a port to `smooth --json`.

`python -m tests.kit.way_of_a_reading` writes those that change its type into ARCHITECTURE.md.

The serving cell of a simulated modem falls by 1 dB with each poll, so three readings have levels
that no other has; a single one might be delayed or pooled. The real service records, the desktop
program estimates, and a profiler looks at what each function is given and returns: the reading is
there where its row or its level is.
"""

import dataclasses
import io
import re
import struct
import sys
import threading
from collections import Counter, defaultdict
from collections.abc import Iterable
from contextlib import redirect_stdout
from pathlib import Path
from tempfile import TemporaryDirectory
from types import FrameType
from typing import Any, NamedTuple

import numpy as np

import logger
from logger.config import parse_config
from logger.device.clock import ScaledClock
from logger.device.service import Service
from logger.device.startup import begin_run
from logger.sim.ptys import PtyDevice, answering, talking
from logger.sim.scenario import scenario
from logger.sim.walk import WalkTime
from postproc.cli import main

_TREE = Path(logger.__file__).resolve().parents[1]
LEVELS_DBM, INDICES, FIRST_INDEX = (-72.0, -73.0, -74.0), (41, 40, 39), 48
_ROW = re.compile(rf'\+CENG: 0,"\d+,(?:{"|".join(map(str, INDICES))}),')
_PACKED = [struct.pack(form, level) for form in ("<d", "<f") for level in LEVELS_DBM]
_SUMMARIES = {"strongest_dbm", "strongest", "mean_dbm"}
"""Of a cell that the modem came to late, or of its first readings, one may equal a level."""
_MOST_ITEMS, _MOST_BYTES, _DEPTH = 300, 1_000_000, 5
_LOOKS_KNOWN, _LOOKS = 600, 2000
"""Calls of a function that are looked at, where its file is known to have the reading or not."""
CLOCK_RATE, POLL_S, N_POLLS = 12.0, 6.0, 21
"""A walker goes 8 m between two polls: each reading is a block of its own."""
MOST_S = 600.0
"""Of the walk. On a busy machine polls are missed, since it goes 12 times as fast as the clock."""


PAGE = _TREE / "ARCHITECTURE.md"
_LISTED = re.compile(r"(?:^`[\w/]+/\{[\w,]+\}\.py`\n)+", re.MULTILINE)


class Way(NamedTuple):
    """Files in the order in which the reading comes to them.

    `changes` are those in which a function is given it in one type and returns it in another, with
    these functions; `holders` are all files that have it.
    """

    changes: dict[str, list[str]]
    holders: list[str]


class _Falling:
    """A simulated SIM800 whose serving cell has the levels -66 dBm, -67 dBm ..."""

    def __init__(self, modem: Any) -> None:
        self._modem = modem
        self.n_polls = 0
        self.cell = ""

    def unsolicited(self) -> bytes:
        return self._modem.unsolicited()

    def feed(self, data: bytes) -> bytes:
        out = self._modem.feed(data)
        if b"+CENG: 0," not in out:
            return out
        self.n_polls += 1
        index = max(FIRST_INDEX - self.n_polls, 0)
        out = re.sub(rb'(\+CENG: [1-9],"\d+,)\d\d', rb"\g<1>20", out)
        out = re.sub(rb'(\+CENG: 0,"\d+,)\d\d', rb"\g<1>%02d" % index, out)
        form = rb'CENG: 0,"\d+,\d+,\d+,(\d+),(\d+),\d+,(\w+),\d+,\d+,(\w+)'
        row = re.search(form, out)
        if row and index >= min(INDICES):
            mcc, mnc, cid, lac = (text.decode() for text in row.groups())
            self.cell = f"{mcc}-{mnc}-{int(lac, 16)}-{int(cid, 16)}"
        return out


class _Tracer:
    """A profiler for `sys.setprofile`."""

    def __init__(self) -> None:
        self.changes: dict[str, list[str]] = {}
        self.holders: dict[str, None] = {}
        self._calls: Counter[tuple[str, str]] = Counter()
        self._local = threading.local()

    def __call__(self, frame: FrameType, event: str, value: object) -> None:
        code = frame.f_code
        path = code.co_filename.removeprefix(f"{_TREE}/")
        is_ours = path.startswith(("logger/", "postproc/")) and "/sim/" not in path
        if event not in {"call", "return"} or not is_ours or getattr(self._local, "is_busy", False):
            return
        name = code.co_qualname
        self._calls[path, name] += 1
        if self._calls[path, name] > (_LOOKS_KNOWN if path in self.holders else _LOOKS):
            return
        self._local.is_busy = True
        try:
            n_arguments = code.co_argcount + code.co_kwonlyargcount
            names = [one for one in code.co_varnames[:n_arguments] if one not in {"self", "cls"}]
            given = {holder(frame.f_locals.get(one)) for one in names} - {""}
            returned = holder(value) if event == "return" else ""
            if given or returned:
                self.holders.setdefault(path)
            if given and returned and returned not in given | {"float"}:
                change = f"{name}: {' '.join(sorted(given))} -> {returned}"
                if change not in self.changes.setdefault(path, []):
                    self.changes[path].append(change)
        finally:
            self._local.is_busy = False


def holder(value: Any, depth: int = _DEPTH) -> str:
    """The type that holds the reading in a value, inside of lists and dicts; "" without it."""
    plain = _holder_of_plain(value)
    if plain is not None:
        return plain
    if depth == 0 or callable(value):
        return ""
    is_own = type(value).__module__.startswith(("logger", "postproc"))
    if isinstance(value, dict | list | tuple | set | frozenset):
        plain_items = value.values() if isinstance(value, dict) else value
        if is_own and hasattr(value, "_fields"):
            plain_items = [getattr(value, one) for one in value._fields if one not in _SUMMARIES]
        items = list(plain_items)[:_MOST_ITEMS]
        inner = next((name for item in items if (name := holder(item, depth - 1))), "")
        return type(value).__name__ if inner and is_own else inner
    if not is_own:
        return ""
    names = (
        [field.name for field in dataclasses.fields(value)]
        if dataclasses.is_dataclass(value)
        else getattr(type(value), "__struct_fields__", ())
    )
    has_it = any(
        holder(getattr(value, name, None), depth - 1) for name in names if name not in _SUMMARIES
    )
    return type(value).__name__ if has_it else ""


def _holder_of_plain(value: Any) -> str | None:
    """As `holder` for numbers, texts and arrays; None for any other value."""
    match value:
        case float():
            return "float" if value in LEVELS_DBM else ""
        case str():
            return "str" if len(value) < _MOST_BYTES and _ROW.search(value) else ""
        case bytes() | bytearray():
            is_short = len(value) < _MOST_BYTES
            is_packed = is_short and any(packed in value for packed in _PACKED)
            is_row = is_short and _ROW.search(value.decode("latin-1")) is not None
            return "bytes" if is_packed or is_row else ""
        case np.ndarray():
            return _holder_of_array(value)
        case None | int() | type():
            return ""
    return None


def _holder_of_array(value: Any) -> str:
    if value.dtype.names:
        columns = (value[name] for name in value.dtype.names if value.dtype[name].kind == "f")
        return "table" if any(np.any(np.isin(column, LEVELS_DBM)) for column in columns) else ""
    is_there = (
        value.dtype.kind == "f" and value.size < _MOST_BYTES and np.any(np.isin(value, LEVELS_DBM))
    )
    return "array" if is_there else ""


def way_of_a_reading(folder: Path) -> Way:
    """Record a walk, estimate, and say through which files the reading has come."""
    tracer = _Tracer()
    threading.setprofile(tracer)
    sys.setprofile(tracer)
    try:
        run, cell = _recorded_run(folder)
        with redirect_stdout(io.StringIO()):
            assert main(["smooth", str(run), "--json", "--cell", cell]) == 0
    finally:
        sys.setprofile(None)
        threading.setprofile(None)
    return Way(tracer.changes, list(tracer.holders))


def _recorded_run(folder: Path) -> tuple[Path, str]:
    walk, clock = scenario("block", 1, MOST_S + 20.0), ScaledClock(CLOCK_RATE)
    time = WalkTime(clock)
    modem = _Falling(walk.modem(time.now_s))
    receiver = talking(walk.receiver(cold_start_s=3.0), time)
    with PtyDevice(answering(modem)) as modem_port, PtyDevice(receiver) as gnss_port:
        text = (
            f'[run]\ndirectory = "{folder}"\n[modem]\nport = "{modem_port.path}"\n'
            f"poll_interval_s = {POLL_S}\n"
            f'[gnss]\nport = "{gnss_port.path}"\n[live]\nmax_fix_age_s = 20.0\n'
            'target = "strongest"\n'  # the falling cell is the target to begin with
        )
        config = parse_config(text, "site.toml")
        service = Service(config, begin_run(config, text, clock), clock, threading.Event())
        service.start()
        while modem.n_polls < N_POLLS and time.now_s() < MOST_S:
            service.wait(POLL_S)
        run = service.stop("end")
    assert modem.n_polls >= N_POLLS > FIRST_INDEX - min(INDICES)
    return run, modem.cell


def listed_files() -> set[str]:
    """The files that ARCHITECTURE.md lists."""
    lines = (line.strip("`").removesuffix(".py") for line in list_of_the_page().splitlines())
    each = (line.split("/{") for line in lines)
    return {f"{folder}/{name}.py" for folder, names in each for name in names[:-1].split(",")}


def as_listed(paths: Iterable[str]) -> str:
    """Files as ARCHITECTURE.md lists them, a line for each folder."""
    by_folder = defaultdict(list)
    for path in map(Path, paths):
        by_folder[path.parent].append(path.stem)
    return "".join(
        f"`{folder}/{{{','.join(sorted(names))}}}.py`\n"
        for folder, names in sorted(by_folder.items())
    )


def list_of_the_page() -> str:
    """The list in ARCHITECTURE.md."""
    (text,) = _LISTED.findall(PAGE.read_text())
    return text


if __name__ == "__main__":
    with TemporaryDirectory() as folder:
        changes = way_of_a_reading(Path(folder)).changes
    for file, what in changes.items():
        print(f"{file}: {'; '.join(what)}")
    PAGE.write_text(PAGE.read_text().replace(list_of_the_page(), as_listed(changes)))
