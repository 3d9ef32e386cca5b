"""Tests of the receiver: positions, satellites, and signs of jamming or of a fake signal."""

import re
from collections.abc import Iterator

import numpy as np

from logger.core.places import UERE_M
from logger.core.rows import Rows
from logger.core.runfile import Run
from logger.core.source_tables import GNSS
from logger.core.types import DEAD_RECKONING
from logger.device.check_line import Line

COARSE_M = 15.0
"""Median accuracy of a receiver under open sky is well below this."""

GOOD_SHARE = 0.8
RECENT_FIXES = 10
"""The receiver works if this share of its latest fixes has a position, whatever came before."""

_RECENT_NS = 5 * 10**9
"""Every receiver lists its satellites once in this time."""
_USABLE_DBHZ = 25
"""A receiver can use a satellite from about this carrier-to-noise density on."""
_ENOUGH = 5
"""Four satellites give a position; one more to be sure."""
_FASTEST_MPS = 70.0
"""Of a car on a motorway."""
_NOISE_M = 50.0
"""Reflections among houses move a position this far at once."""
_DEGREE_M = 111_200.0
_SENTENCE = re.compile(rb"\$(..)GSV,\d+,\d+,\d*((?:,\d*)*)(?:,[0-9A-F])?\*[0-9A-F]{2}")


def fixes_lines(run: Run, fixes: Rows) -> Iterator[Line]:
    """Evaluate fixes of a run, and the satellites in the receiver's latest sentences."""
    yield _fixes_line(fixes, satellites_in_use(run))
    n_jumps, farthest_m = jumps(fixes)
    if n_jumps:
        text = (
            f"the position jumped {n_jumps} times, once by {farthest_m:.0f} m: "
            "reflections between high houses, or a fake signal; walk on and try again"
        )
        yield Line("warn", "jumps", text)


def satellites_in_use(run: Run) -> int | None:
    """Satellites that are received well enough, by the receiver's GSV; None without one."""
    raw = run.tables["raw"]
    receivers = np.append(run.tables["fixes"]["source"], GNSS.encode())
    received = raw[np.isin(raw["source"], receivers) & (raw["sent"] == 0)]
    if not len(received):
        return None
    latest = received[received["t_ns"] >= received["t_ns"][-1] - _RECENT_NS]
    spans = zip(latest["offset"].tolist(), latest["length"].tolist(), strict=True)
    text = b"".join(run.raw_bytes[start : start + length].tobytes() for start, length in spans)
    sentences = _SENTENCE.findall(text)
    if not sentences:
        return None
    return len({key for talker, values in sentences for key in _usable(talker, values)})


def _usable(talker: bytes, values: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Satellites of a sentence: number, elevation, azimuth and density of each."""
    fields = values.split(b",")[1:]
    for i in range(0, len(fields) - 3, 4):
        if fields[i + 3].isdigit() and int(fields[i + 3]) >= _USABLE_DBHZ:
            yield talker, fields[i]


def jumps(fixes: Rows) -> tuple[int, float]:
    """Steps of the position that no car makes: their number, and the longest in metres."""
    valid = fixes[(fixes["valid"] == 1) & np.isfinite(fixes["lat_deg"])]
    if len(valid) < 2:
        return 0, 0.0
    since_s = np.diff(valid["t_ns"]) / 1e9
    north_m = np.diff(valid["lat_deg"]) * _DEGREE_M
    east_m = np.diff(valid["lon_deg"]) * _DEGREE_M * np.cos(np.radians(valid["lat_deg"][1:]))
    step_m = np.hypot(north_m, east_m)
    is_jump = step_m > _NOISE_M + _FASTEST_MPS * since_s
    return int(np.count_nonzero(is_jump)), float(step_m[is_jump].max(initial=0.0))


def _fixes_line(fixes: Rows, satellites: int | None) -> Line:
    if not len(fixes):
        return Line("fail", "gnss", "nothing received: right port and baud? see fieldlogger probe")
    valid = fixes[fixes["valid"] == 1]
    if not len(valid):
        return Line("warn", "gnss", _no_position(satellites))
    recent = valid["quality"][-RECENT_FIXES:]
    if np.mean(recent == DEAD_RECKONING) > 1.0 - GOOD_SHARE:
        text = "positions by dead reckoning get little weight: has the antenna a clear sky?"
        return Line("warn", "gnss", text)
    sigma_m = np.where(np.isfinite(valid["acc_m"]), valid["acc_m"], valid["hdop"] * UERE_M)
    is_known = bool(np.any(np.isfinite(sigma_m)))
    median_m = float(np.nanmedian(sigma_m)) if is_known else 0.0
    accuracy = f"about {median_m:.0f} m" if is_known else "unknown"
    is_good = np.mean(fixes["valid"][-RECENT_FIXES:]) > GOOD_SHARE and median_m <= COARSE_M
    text = f"{len(valid)} of {len(fixes)} fixes with a position, accuracy {accuracy}"
    return Line("ok" if is_good else "warn", "gnss", text)


def _no_position(satellites: int | None) -> str:
    if satellites is None:
        return "the receiver has no position yet: a cold start under open sky takes minutes"
    if satellites < _ENOUGH:
        return f"no position: {satellites} satellites are received; go under open sky"
    return (
        f"no position although {satellites} satellites are received: a cold start takes a minute; "
        "if it lasts, the receiver is jammed or gets a fake signal: try another place"
    )
