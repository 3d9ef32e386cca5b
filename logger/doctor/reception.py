"""Tests of a run: whether the modem and the receiver give what a walk needs."""

import re
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from logger.config import ModemSettings, SourceSettings
from logger.core.baseline import Baseline, square_of
from logger.core.places import UERE_M
from logger.core.rows import Rows, levels_dbm
from logger.core.runfile import Run
from logger.core.source_tables import GNSS, MODEM
from logger.core.types import DEAD_RECKONING
from logger.device.link import Line, State
from logger.drivers.registry import FAMILIES

COARSE_M = 15.0
"""Median accuracy of a receiver under open sky is well below this."""

GOOD_SHARE = 0.8
RECENT_FIXES = 10
"""The receiver works if this share of its latest fixes has a position."""

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
    """`values` has number, elevation, azimuth and density of each satellite."""
    fields = values.split(b",")[1:]
    for i in range(0, len(fields) - 3, 4):
        if fields[i + 3].isdigit() and int(fields[i + 3]) >= _USABLE_DBHZ:
            yield talker, fields[i]


def jumps(fixes: Rows) -> tuple[int, float]:
    """Steps of the position that no car makes: number, and the longest in metres."""
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


LOST_DB = 20.0
"""A modem without an antenna receives some 20 dB less; two modems differ by a few."""
WEAK_DBM: Mapping[bytes, float] = {b"GSM": -95.0, b"WCDMA": -105.0, b"LTE": -115.0}
"""Outdoors the strongest cell is seldom so weak, some 10 dB above what a modem can hear."""
_FEWEST = 3
"""Cells that are compared: one alone may have changed."""


def antenna_line(readings: Rows, fixes: Rows, baseline: Baseline | None) -> Line | None:
    """Compare with earlier walks here, else with what is usual outdoors; None without a level."""
    heard = _mean_levels(readings)
    if not heard:
        return None
    differences = _differences(heard, fixes, baseline)
    if len(differences) >= _FEWEST:
        median_db = float(np.median(differences))
        text = f"{len(differences)} cells are {abs(median_db):.0f} dB"
        if median_db <= -LOST_DB:
            text = f"{text} weaker here than on earlier walks: is the antenna connected?"
            return Line("warn", "antenna", text)
        side = "stronger" if median_db > 0 else "weaker"
        return Line("ok", "antenna", f"{text} {side} here than on earlier walks")
    return _absolute(readings)


def _mean_levels(readings: Rows) -> dict[str, float]:
    levels = levels_dbm(readings)
    usable = (readings["cell"] != b"") & np.isfinite(levels)
    cells = readings["cell"][usable]
    return {
        name.decode(): float(np.mean(levels[usable][cells == name])) for name in np.unique(cells)
    }


def _differences(heard: dict[str, float], fixes: Rows, baseline: Baseline | None) -> list[float]:
    valid = fixes[fixes["valid"] == 1]
    if baseline is None or not len(valid):
        return []
    place = square_of(float(valid["lat_deg"][-1]), float(valid["lon_deg"][-1]))
    known = baseline.square(place).cells
    return [level - known[name].mean_dbm for name, level in heard.items() if name in known]


def _absolute(readings: Rows) -> Line:
    levels = levels_dbm(readings)
    for rat, weak_dbm in WEAK_DBM.items():
        own = levels[(readings["rat"] == rat) & np.isfinite(levels)]
        if not len(own):
            continue
        text = f"strongest {rat.decode()} cell {own.max():.0f} dBm"
        if own.max() < weak_dbm:
            text = f"{text}: weak for a place outdoors; is the antenna connected?"
            return Line("warn", "antenna", text)
        return Line("ok", "antenna", text)
    return Line("ok", "antenna", "no level of GSM, UMTS or LTE to compare")


TRIAL = "doctor"
"""Origin of a run that the doctor records itself."""

LAST_S = 60.0
"""The end of a run that is tested: a slow modem gives several scans in it."""


def run_lines(
    run: Run,
    *,
    sources: Sequence[SourceSettings] = (),
    baseline: Baseline | None = None,
) -> Iterator[Line]:
    """Evaluate the end of a run; `sources` are those of the configuration."""
    tables = run.tables
    end_ns = max((int(rows["t_ns"].max()) for rows in tables.values() if len(rows)), default=0)
    begin_ns = max(run.meta.started_ns, end_ns - round(LAST_S * 1e9))
    minutes = max(end_ns - begin_ns, 1) / 60e9
    scans, readings, fixes = (
        tables[name][tables[name]["t_ns"] >= begin_ns] for name in ("scans", "readings", "fixes")
    )
    names = [source.name for source in sources if source.gives_cells] or [MODEM]
    for name in names:
        notes = _notes_of(run, name)
        event = notes[-1][1] if notes else ""
        n_scans = np.count_nonzero(scans["source"] == name.encode())
        if n_scans:
            yield Line("ok", name, f"{n_scans / minutes:.0f} scans a minute; {event}")
        else:
            yield Line("fail", name, f"no scan; last event: {event or 'none'}")
    every = [note for name in names for note in _notes_of(run, name)]
    modes = [one.set_mode for one in sources if isinstance(one, ModemSettings)]
    set_mode = next(filter(None, modes), "")
    yield _readings_line(readings, minutes, every, run.meta.origin == TRIAL, set_mode)
    if (antenna := antenna_line(readings, fixes, baseline)) is not None:
        yield antenna
    yield from fixes_lines(run, fixes)


def _notes_of(run: Run, modem: str) -> list[tuple[str, str]]:
    return [
        (row["code"].decode(), row["text"].decode())
        for row in run.tables["notes"]
        if row["source"] == modem.encode()
    ]


def _readings_line(
    readings: Rows, minutes: float, notes: list[tuple[str, str]], is_trial: bool, set_mode: str
) -> Line:
    usable = (readings["cell"] != b"") & np.isfinite(levels_dbm(readings))
    cells = len(np.unique(readings["cell"][usable]))
    if cells:
        text = f"{np.count_nonzero(usable) / minutes:.0f} usable a minute, of {cells} cells"
    else:
        text = "no cell with identity and level: antenna connected? 2G here? SIM locked by its PIN?"
    others = _other_technologies(readings)
    if others:
        text = f"{text}; {others}; {_gsm_only(notes, set_mode)}"
    # a trial leaves the modem's mode alone, which the service will set
    is_set_later = is_trial and set_mode
    state: State = "warn" if not cells or (others and not is_set_later) else "ok"
    return Line(state, "readings", text)


def _other_technologies(readings: Rows) -> str:
    received = sorted({rat.decode() for rat in readings["rat"]} - {""})
    if not received or "GSM" in received:
        return ""
    return f"only {' and '.join(received)}: a 2G catcher would not be recorded"


def _gsm_only(notes: list[tuple[str, str]], set_mode: str) -> str:
    refusals = [text for code, text in notes if code == "mode-unchanged"]
    if refusals:
        return refusals[-1]
    if set_mode:
        return f'`fieldlogger run` sets it to GSM only (set_mode = "{set_mode}")'
    drivers = [text.rpartition(" ")[2] for code, text in notes if code == "modem-ready"]
    driver = FAMILIES.get(drivers[-1]) if drivers else None
    if driver is None or not driver.mode_commands:
        return "the driver has no command for GSM only: set the modem by hand, or use another"
    commands = " or ".join(command.set_to(command.gsm_only) for command in driver.mode_commands)
    return f'set_mode = "gsm" ({commands})'
