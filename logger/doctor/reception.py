"""Tests of a run: whether the modem and the receiver give what a walk needs."""

from collections.abc import Iterator, Sequence

import numpy as np

from logger.config import ModemSettings, SourceSettings
from logger.core.baseline import Baseline
from logger.core.censoring import levels_dbm
from logger.core.rows import Rows
from logger.core.runfile import Run
from logger.core.source_tables import MODEM
from logger.device.check_line import Line, State
from logger.doctor.antenna import antenna_line
from logger.doctor.receiver import fixes_lines
from logger.drivers.registry import FAMILIES

TRIAL = "doctor"
"""Origin of a run that the doctor records itself."""

LAST_S = 60.0
"""The end of a run that is tested: a slow modem still gives several scans in it."""


def run_lines(
    run: Run,
    last_s: float = LAST_S,
    *,
    sources: Sequence[SourceSettings] = (),
    baseline: Baseline | None = None,
) -> Iterator[Line]:
    """Evaluate the end of a run; `sources` are those of the configuration."""
    tables = run.tables
    end_ns = max((int(rows["t_ns"].max()) for rows in tables.values() if len(rows)), default=0)
    begin_ns = max(run.meta.started_ns, end_ns - round(last_s * 1e9))
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
    """Code and text of each note about a modem."""
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
    """Which technologies are received without GSM; empty with GSM, or if none is known."""
    received = sorted({rat.decode() for rat in readings["rat"]} - {""})
    if not received or "GSM" in received:
        return ""
    return f"only {' and '.join(received)}: a 2G catcher would not be recorded"


def _gsm_only(notes: list[tuple[str, str]], set_mode: str) -> str:
    """How to make the modem receive GSM."""
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
