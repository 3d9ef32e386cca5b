"""What holds for a while: verdict, stage of the live estimate, fix; and the events between."""

from collections.abc import Sequence

import numpy as np
import rerun as rr

from logger.core.arrays import IntArray
from logger.core.rows import Rows
from postproc.pictures import colours
from postproc.pictures.colours import Colour
from postproc.view.ground import colour_of_verdict
from postproc.view.rerun_writer import Sheet, entity
from postproc.view.view_model import Story, Subject

_LEVELS = {b"info": "INFO", b"warning": "WARN", b"error": "ERROR"}
_GREEN: Colour = (50, 140, 80)
_RED: Colour = (190, 50, 60)
_STATES: dict[str, Colour] = {
    **{verdict: colour_of_verdict(verdict) for verdict in ("located", "ambiguous", "cannot tell")},
    "locator": colours.POSTERIOR,
    "ekf": colours.EKF,
    "fix": _GREEN,
    "no fix": _RED,
}


def draw_states(sheet: Sheet, story: Story) -> None:
    """Lanes of states for each cell told in full, one for the receiver, and the notes of all
    runs.
    """
    for walk in story.walks:
        fixes = walk.run.tables["fixes"]
        found = ["fix" if valid else "no fix" for valid in fixes["valid"]]
        _lane(sheet, "states/receiver", fixes["t_ns"], found)
        _events(sheet, walk.run.tables["notes"])
    for subject in story.subjects:
        _verdicts(sheet, subject)
        for walk in story.walks:
            _stages(sheet, subject, walk.run.tables["live"])


def _verdicts(sheet: Sheet, subject: Subject) -> None:
    path, times = (
        entity("states", subject.cell, "verdict"),
        np.array([step.t_ns for step in subject.steps], np.int64),
    )
    _lane(sheet, path, times, [step.verdict for step in subject.steps])


def _stages(sheet: Sheet, subject: Subject, live: Rows) -> None:
    """Which estimator spoke for the cell on the device."""
    mine = live[
        (live["cell"] == subject.cell.encode()) & np.isin(live["stage"], (b"locator", b"ekf"))
    ]
    _lane(
        sheet,
        entity("states", subject.cell, "live_stage"),
        mine["t_ns"],
        [_text(stage) for stage in mine["stage"]],
    )


def _lane(sheet: Sheet, path: str, t_ns: IntArray, states: Sequence[str]) -> None:
    """States at the times when they change."""
    order = np.argsort(t_ns, kind="stable")
    told = [states[i] for i in order]
    changed = [i for i, state in enumerate(told) if i == 0 or state != told[i - 1]]
    if not changed:
        return
    known = list(_STATES)
    inks = [_STATES[state] for state in known]
    sheet.always(path, rr.StateConfiguration(values=known, labels=known, colors=inks))
    sheet.over_time(
        path, t_ns[order][changed], rr.StateChange.columns(state=[told[i] for i in changed])
    )


def _events(sheet: Sheet, notes: Rows) -> None:
    notes = notes[np.argsort(notes["t_ns"], kind="stable")]
    if not len(notes):
        return
    texts = [f"{_text(row['source'])}: {_text(row['text']) or _text(row['code'])}" for row in notes]
    levels = [_LEVELS.get(level, "INFO") for level in notes["level"].tolist()]
    sheet.over_time("events", notes["t_ns"], rr.TextLog.columns(text=texts, level=levels))


def _text(raw: bytes) -> str:
    return raw.decode("utf-8", "replace")
