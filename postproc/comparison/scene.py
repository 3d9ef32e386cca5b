"""A comparison as a recording for the rerun viewer: the words, and a map of each changed cell."""

from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from logger.core.document import Column, Table, markdown_table, markdown_text
from postproc.atomic_write import whole_file
from postproc.comparison.changes import CellChange, ComparedRuns, Shade, cells_on_maps, shade_of
from postproc.comparison.ground import BLOCK_M, Grid
from postproc.view.plan import entity
from postproc.view.scene import recording_of

_INKS: dict[Shade, tuple[int, int, int]] = {
    "more": (200, 60, 40),
    "less": (40, 90, 200),
    "single": (150, 150, 150),
}


def write_comparison(compared: ComparedRuns, path: Path) -> None:
    """Write the recording (.rrd), complete or not at all; raises `RunFileError`."""
    changed = cells_on_maps(compared.comparison.cells)
    name = f"{compared.a.name} {compared.b.name}"
    with (
        whole_file(path) as part,
        recording_of(part, f"comparison {name}", name, _layout(changed)) as recording,
    ):
        text = rr.TextDocument(_report(compared), media_type=rr.MediaType.MARKDOWN)
        recording.log("words", text, static=True)
        for cell in changed:
            blocks = _blocks(cell, compared.comparison.grid)
            recording.log(entity("change", cell.cell), blocks, static=True)


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
    shades = map(shade_of, cell.difference_db.tolist())
    return rr.Boxes2D(
        centers=np.column_stack([x_m - np.min(x_m), np.max(y_m) - y_m]),
        half_sizes=np.full((len(x_m), 2), 0.5 * BLOCK_M),
        colors=[(*_INKS[kind], round(60 + 195 * strength)) for kind, strength in shades],
        labels=labels,
        show_labels=False,
    )
