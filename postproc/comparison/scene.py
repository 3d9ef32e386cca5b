"""A comparison as a recording for the rerun viewer: the words, and a map of each changed cell."""

from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from logger.core.arrays import FloatArray
from logger.core.document import Column, Table, markdown_table, markdown_text
from postproc.atomic_write import whole_file
from postproc.comparison.changes import CellChange, ComparedRuns
from postproc.comparison.ground import BLOCK_M, Grid
from postproc.view.plan import entity
from postproc.view.scene import APPLICATION

_MOST_MAPS = 12
_FULL_DB = 15.0
"""Difference from which a colour is full."""
_MORE, _LESS, _SINGLE = (200, 60, 40), (40, 90, 200), (150, 150, 150)


def write_comparison(compared: ComparedRuns, path: Path) -> None:
    """Write the recording (.rrd), complete or not at all; raises `RunFileError`."""
    changed = [cell for cell in compared.comparison.cells if cell.is_change][:_MOST_MAPS]
    with whole_file(path) as part:
        rr.set_strict_mode(True)
        name = f"{compared.a.name} {compared.b.name}"
        recording = rr.RecordingStream(APPLICATION, recording_id=f"comparison {name}")
        recording.set_log_time_enabled(False)
        recording.save(part)
        recording.send_blueprint(_layout(changed), make_active=True, make_default=True)
        recording.send_recording_name(name)
        text = rr.TextDocument(_report(compared), media_type=rr.MediaType.MARKDOWN)
        recording.log("words", text, static=True)
        for cell in changed:
            blocks = _blocks(cell, compared.comparison.grid)
            recording.log(entity("change", cell.cell), blocks, static=True)
        recording.flush()
        recording.disconnect()


def _layout(changed: list[CellChange]) -> rrb.Blueprint:
    maps = [
        rrb.Spatial2DView(origin=entity("change", cell.cell), name=f"{cell.cell}: {cell.word}")
        for cell in changed
    ]
    words = rrb.TextDocumentView(origin="words", name="words")
    views = rrb.Horizontal(words, rrb.Grid(*maps)) if maps else rrb.Horizontal(words)
    return rrb.Blueprint(views, collapse_panels=True)


def _report(compared: ComparedRuns) -> str:
    cells = sorted(compared.comparison.cells, key=lambda cell: not cell.is_change)
    columns = (Column("cell"), Column("word"), Column("why"))
    title = f"# {markdown_text(compared.b.name)} compared with {markdown_text(compared.a.name)}"
    colours = "Red: stronger in the second walk. Blue: weaker. Grey: heard by one walk alone."
    table = Table(columns, [(cell.cell, cell.word, cell.text) for cell in cells])
    return "\n\n".join([title, colours, markdown_table(table)])


def _blocks(cell: CellChange, grid: Grid) -> rr.Boxes2D:
    """North up: the vertical axis of a 2D view points down."""
    x_m, y_m = grid.centres_m(cell.block)
    labels = ["one walk" if np.isnan(db) else f"{db:+.0f} dB" for db in cell.difference_db]
    return rr.Boxes2D(
        centers=np.column_stack([x_m - np.min(x_m), np.max(y_m) - y_m]),
        half_sizes=np.full((len(x_m), 2), 0.5 * BLOCK_M),
        colors=_colours(cell.difference_db),
        labels=labels,
        show_labels=False,
    )


def _colours(difference_db: FloatArray) -> list[tuple[int, int, int, int]]:
    """Grey where only one walk heard the cell."""
    colours = []
    for db in difference_db:
        ink = _SINGLE if np.isnan(db) else _MORE if db > 0.0 else _LESS
        strength = 1.0 if np.isnan(db) else min(abs(float(db)) / _FULL_DB, 1.0)
        colours.append((*ink, round(60 + 195 * strength)))
    return colours
