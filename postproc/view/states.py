"""States over time: verdict, stage of the live estimate, fix; and the events of the run."""

from collections.abc import Sequence

import numpy as np
import rerun as rr

from logger.core.arrays import IntArray
from logger.core.rows import Rows
from postproc.pictures import colours
from postproc.pictures.colours import Colour
from postproc.view.rerun_writer import RerunWriter, entity
from postproc.view.view_model import CellView, ViewModel

_LEVELS = {b"info": "INFO", b"warning": "WARN", b"error": "ERROR"}
_STATES: dict[str, Colour] = {
    **{name: colours.verdict_colour(name) for name in ("located", "ambiguous", "cannot tell")},
    "locator": colours.POSTERIOR,
    "ekf": colours.EKF,
    "fix": colours.GREEN,
    "no fix": colours.RED,
}


def draw_states(writer: RerunWriter, view: ViewModel) -> None:
    """Lanes of states for each detailed cell, one for the receiver, and the notes of all runs."""
    for walk in view.survey.walks:
        fixes = walk.run.tables["fixes"]
        states = ["fix" if valid else "no fix" for valid in fixes["valid"]]
        _draw_lane(writer, "states/receiver", fixes["t_ns"], states)
        _draw_events(writer, walk.run.tables["notes"])
    for cell in view.cell_views:
        path = entity("states", cell.name, "verdict")
        _draw_lane(writer, path, cell.t_ns, [step.verdict for step in cell.steps])
        for walk in view.survey.walks:
            _draw_stages(writer, cell, walk.run.tables["live"])


def _draw_stages(writer: RerunWriter, cell: CellView, live: Rows) -> None:
    """The estimator whose answer the device used for the cell."""
    is_cell = live["cell"] == cell.name.encode()
    rows = live[is_cell & np.isin(live["stage"], (b"locator", b"ekf"))]
    stages = [_text(stage) for stage in rows["stage"]]
    _draw_lane(writer, entity("states", cell.name, "live_stage"), rows["t_ns"], stages)


def _draw_lane(writer: RerunWriter, path: str, t_ns: IntArray, states: Sequence[str]) -> None:
    """States at the times when they change."""
    order = np.argsort(t_ns, kind="stable")
    in_order = np.array(states, object)[order]
    changes = np.flatnonzero(np.append(True, in_order[1:] != in_order[:-1])[: len(in_order)])
    if not len(changes):
        return
    names = list(_STATES)
    inks = list(_STATES.values())
    writer.log_static(path, rr.StateConfiguration(values=names, labels=names, colors=inks))
    columns = rr.StateChange.columns(state=in_order[changes].tolist())
    writer.send_columns(path, t_ns[order][changes], columns)


def _draw_events(writer: RerunWriter, notes: Rows) -> None:
    notes = notes[np.argsort(notes["t_ns"], kind="stable")]
    if not len(notes):
        return
    texts = [f"{_text(row['source'])}: {_text(row['text']) or _text(row['code'])}" for row in notes]
    levels = [_LEVELS.get(level, "INFO") for level in notes["level"].tolist()]
    writer.send_columns("events", notes["t_ns"], rr.TextLog.columns(text=texts, level=levels))


def _text(raw: bytes) -> str:
    return raw.decode("utf-8", "replace")
