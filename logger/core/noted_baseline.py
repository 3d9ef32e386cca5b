"""What a live estimate was told of earlier walks, recorded with the run.

The baseline of a device grows with each run, and its runs end. So each answer is recorded as bytes
of the source "live", a line of JSON, when it is given first: the words of the run can be repeated
without the file. Questions that are not there had no answer.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import msgspec
import numpy as np

from logger.core.baseline import (
    NO_BASELINE,
    Baseline,
    KnownCell,
    SquareHistory,
)
from logger.core.runfile import Run

SOURCE = "live"
READ, UNREADABLE = "baseline", "baseline-unreadable"
"""Codes of the events: a baseline is read, and none is from now on."""


class _Line(msgspec.Struct, omit_defaults=True):
    """The file as a whole, or one answer."""

    n_walks: int | None = None
    fingerprint: str = ""
    square: SquareHistory | None = None
    cell: KnownCell | None = None
    trusted: tuple[str, str] | None = None
    operator: tuple[str, str, str] | None = None
    channels: dict[int, int] = {}


def line_of_file(baseline: Baseline) -> bytes:
    """How many walks there are, and their digest."""
    return _encoded(_Line(n_walks=baseline.n_walks, fingerprint=baseline.fingerprint))


def line_of_answer(kind: str, key: Any, answer: Any) -> bytes:
    """An answer to the question `kind`, a method of `Baseline`; empty for one without content."""
    match kind:
        case "square" if answer.n_walks:
            return _encoded(_Line(square=answer))
        case "cell" if answer is not None:
            return _encoded(_Line(cell=answer))
        case "trust_note" if answer is not None:
            return _encoded(_Line(trusted=(key, answer)))
        case "channels" if answer:
            return _encoded(_Line(operator=key, channels=dict(answer)))
    return b""


def _encoded(line: _Line) -> bytes:
    return msgspec.json.encode(line, enc_hook=dict) + b"\n"


class NotedBaseline:
    """The answers that a run has; a `Baseline`."""

    def __init__(self, text: bytes) -> None:
        self.n_walks, self.fingerprint = 0, ""
        self._squares: dict[int, SquareHistory] = {}
        self._cells: dict[str, KnownCell] = {}
        self._trust: dict[str, str] = {}
        self._channels: dict[tuple[str, str, str], Mapping[int, int]] = {}
        decode = msgspec.json.Decoder(_Line, dec_hook=lambda _, value: value).decode
        for line in map(decode, text.splitlines()):
            if line.n_walks is not None:
                self.n_walks, self.fingerprint = line.n_walks, line.fingerprint
            if line.square is not None:
                self._squares[line.square.square] = line.square
            if line.cell is not None:
                self._cells[line.cell.name] = line.cell
            if line.trusted is not None:
                self._trust[line.trusted[0]] = line.trusted[1]
            if line.operator is not None:
                self._channels[line.operator] = line.channels

    def square(self, square: int) -> SquareHistory:
        return self._squares.get(square) or SquareHistory(square)

    def cell(self, name: str) -> KnownCell | None:
        return self._cells.get(name)

    def channels(self, mcc: str, mnc: str, rat: str) -> Mapping[int, int]:
        return self._channels.get((mcc, mnc, rat), MappingProxyType({}))

    def trust_note(self, name: str) -> str | None:
        return self._trust.get(name)


def baseline_of(run: Run) -> Baseline:
    """The baseline as the live estimate of a run was told of it; none where it was not."""
    text = _text_of(run)
    if not text:
        return NO_BASELINE
    try:
        return NotedBaseline(text)
    except msgspec.DecodeError:  # no recorder of ours
        return NO_BASELINE


def has_whole_baseline(run: Run) -> bool:
    """Whether `baseline_of` answers as the baseline did on the walk.

    No for runs of versions that recorded no answers, and where the file failed on the way.
    """
    codes = run.tables["notes"]["code"]
    if np.any(codes == UNREADABLE.encode()):
        return not np.any(codes == READ.encode())  # then nothing was known from the beginning
    return not np.any(codes == READ.encode()) or bool(_text_of(run))


def _text_of(run: Run) -> bytes:
    raw = run.tables["raw"]
    rows = raw[raw["source"] == SOURCE.encode()]
    if not len(run.raw_bytes):
        return b""
    spans = zip(rows["offset"].tolist(), rows["length"].tolist(), strict=True)
    return b"".join(run.raw_bytes[start : start + n].tobytes() for start, n in spans)
