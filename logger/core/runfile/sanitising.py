"""Tables of an untrusted run made valid: impossible values become unknown and are counted.

Readers of runs may then rely on it: sums of times fit into 64 bits, positions are on the Earth,
levels are in the range of a modem, text is UTF-8. A run by our recorder is returned unchanged.
"""

from collections.abc import Callable
from typing import get_args

import numpy as np
import numpy.typing as npt

from logger.core.column import UNKNOWN_ID, UNKNOWN_TIME
from logger.core.rows import Rows, channels_of, numbered_texts
from logger.core.schema import MOST_NS, TABLES
from logger.core.types import Level, Rat, Role

_LAST_SEQ = 2**53
"""More records than any card holds; larger numbers are inexact as floats."""
_RANGES = {
    "lat_deg": (-90.0, 90.0),
    "lon_deg": (-180.0, 180.0),
    "alt_m": (-1e12, 1e12),  # as far as the importers go
    "acc_m": (0.0, 1e7),  # receivers without a position report some thousand kilometres
    "hdop": (0.0, 1e6),
    "speed_mps": (-1e12, 1e12),
    "course_deg": (-1e12, 1e12),
    "rssi_dbm": (-200.0, 50.0),
    "rscp_dbm": (-200.0, 50.0),
    "rsrp_dbm": (-200.0, 50.0),
    "ecio_db": (-1e12, 1e12),
    "rsrq_db": (-1e12, 1e12),
    "sinr_db": (-1e12, 1e12),
}
_LARGEST = {
    "ta": 1282,  # LTE (3GPP TS 36.213, 4.2.3); GSM has 63
    "rxlev_raw": 255,
    "cro_db": 126,  # 63 steps of 2 dB (3GPP TS 45.008, 6.4)
    "penalty_time": 31,
}
"""Of whole numbers that are unknown or not negative."""
_WORDS: dict[str, tuple[tuple[str, ...], bytes]] = {
    "role": (get_args(Role), b"scan"),
    "rat": (("", *get_args(Rat)), b""),
    "level": (get_args(Level), b"info"),
}
"""Columns with a fixed set of texts, and the replacement of any other text."""

Truths = npt.NDArray[np.bool_]


def sanitise(tables: dict[str, Rows], n_raw_bytes: int) -> tuple[dict[str, Rows], int]:
    """Valid tables with the current columns, and how many rows and values were invalid."""
    found, n = {}, 0
    for table, rows in tables.items():
        found[table], n_bad = _Sanitiser(table, rows, n_raw_bytes).result()
        n += n_bad
    return found, n


class _Sanitiser:
    """One table, copied when something must be changed."""

    def __init__(self, table: str, rows: Rows, n_raw_bytes: int) -> None:
        self._table = table
        self._n_raw_bytes = n_raw_bytes
        usable = (
            (rows["seq"] >= 0)
            & (rows["seq"] < _LAST_SEQ)
            & (rows["t_ns"] >= -MOST_NS)
            & (rows["t_ns"] <= MOST_NS)
        )
        self._n_bad = int(len(rows) - np.count_nonzero(usable))
        self._rows = rows[usable] if self._n_bad else rows
        self._copied = bool(self._n_bad)

    def result(self) -> tuple[Rows, int]:
        if len(self._rows):
            for column in TABLES[self._table]:
                if column.dtype.startswith("S"):
                    self._text(column.name)
            of_table: dict[str, Callable[[], None]] = {
                "fixes": self._fixes,
                "scans": self._times,
                "readings": self._readings,
                "broadcasts": self._broadcasts,
                "live": self._live,
                "raw": self._raw,
            }
            of_table.get(self._table, lambda: None)()
        return self._rows, self._n_bad

    def _replace(self, name: str, bad: Truths, value: object) -> None:
        if not (n := int(np.count_nonzero(bad))):
            return
        if not self._copied:
            self._rows, self._copied = self._rows.copy(), True
        self._rows[name][bad] = value
        self._n_bad += n

    def _text(self, name: str) -> None:
        column = self._rows[name]
        letters = np.ascontiguousarray(column).view(np.uint8).reshape(len(column), -1)
        is_odd = letters >= 0x80
        is_odd[:, 1:] |= (letters[:, 1:] != 0) & (letters[:, :-1] == 0)  # NUL within the text
        for i in np.flatnonzero(is_odd.any(axis=1)).tolist() if is_odd.any() else ():
            text = bytes(column[i])
            if (clean := _utf8(text, column.dtype.itemsize)) != text:
                self._replace(name, np.arange(len(column)) == i, clean)
        if name in _WORDS:
            words, instead = _WORDS[name]
            texts, which = numbered_texts(self._rows[name])
            self._replace(name, ~np.isin(texts, [word.encode() for word in words])[which], instead)

    def _numbers(self) -> None:
        for name, (least, most) in _RANGES.items():
            if name in (self._rows.dtype.names or ()):
                values = self._rows[name]
                self._replace(
                    name, ~np.isnan(values) & ~((values >= least) & (values <= most)), np.nan
                )

    def _fixes(self) -> None:
        self._numbers()
        rows = self._rows
        self._replace("valid", rows["valid"] > 1, 1)
        placeless = np.isnan(rows["lat_deg"]) | np.isnan(rows["lon_deg"])
        self._replace("valid", (self._rows["valid"] == 1) & placeless, 0)
        utc_ns = self._rows["utc_ns"]
        self._replace(
            "utc_ns",
            (utc_ns != UNKNOWN_TIME) & ((utc_ns < -MOST_NS) | (utc_ns > MOST_NS)),
            UNKNOWN_TIME,
        )

    def _times(self) -> None:
        start_ns = self._rows["t_start_ns"]
        bad = (start_ns != UNKNOWN_TIME) & ((start_ns < -MOST_NS) | (start_ns > MOST_NS))
        if self._table == "scans":
            bad |= start_ns == UNKNOWN_TIME
        self._replace("t_start_ns", bad, self._rows["t_ns"][bad])

    def _readings(self) -> None:
        self._numbers()
        self._times()
        self._counts("ta", "rxlev_raw")

    def _counts(self, *names: str) -> None:
        for name in names:
            values = self._rows[name]
            bad = (values != UNKNOWN_ID) & ((values < 0) | (values > _LARGEST[name]))
            self._replace(name, bad, UNKNOWN_ID)

    def _broadcasts(self) -> None:
        self._counts("cro_db", "penalty_time")
        texts = self._rows["neighbour_arfcns"]
        bad = [bool(text) and channels_of(text.decode()) is None for text in texts.tolist()]
        self._replace("neighbour_arfcns", np.array(bad), b"")

    def _live(self) -> None:
        zone = np.abs(self._rows["utm_zone"].astype(np.int64))
        self._replace("utm_zone", (zone < 1) | (zone > 60), 1)

    def _raw(self) -> None:
        offset, length = self._rows["offset"], self._rows["length"].astype(np.int64)
        bad = (
            (offset < 0)
            | (length < 0)
            | (offset > self._n_raw_bytes)
            | (length > self._n_raw_bytes - offset)
        )
        self._replace("length", bad, 0)
        self._replace("offset", bad, 0)


def _utf8(text: bytes, size: int) -> bytes:
    """Invalid UTF-8 and NUL are replaced, and the text is shortened to `size` bytes."""
    clean = text.replace(b"\0", b"?").decode("utf-8", "replace").encode()[:size]
    return clean.decode("utf-8", "ignore").encode()
