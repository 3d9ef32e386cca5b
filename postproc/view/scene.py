"""A view model as a recording for the rerun viewer."""

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import rerun as rr

from postproc.atomic_write import whole_file
from postproc.basemap.reading import Basemap
from postproc.cell_work import Attempts, Failure, attempt, attempt_alone
from postproc.result import CellResult
from postproc.view.blueprint import layout
from postproc.view.ground import draw_basemap
from postproc.view.plan import draw_plan
from postproc.view.rerun_writer import RerunWriter, entity
from postproc.view.series import draw_series, draw_states
from postproc.view.summary_text import cell_report, empty_report
from postproc.view.view_model import CellView, ViewModel
from postproc.view.world_map import draw_map

APPLICATION = "cellwalk"

_WHAT = "its drawing"


def write_scene(
    view: ViewModel, path: Path, *, basemap: Basemap | None = None, online: bool = True
) -> tuple[Failure, ...]:
    """Write the recording (.rrd), complete or not at all; raises `RunFileError`.

    `online` is as in `layout`. Returns the cells of which something cannot be shown.
    """

    def write(some: ViewModel) -> None:
        with whole_file(path) as part:
            _write(some, part, basemap, online=online)

    if isinstance(attempt(view.name, _WHAT, lambda: write(view)), Failure):
        view = view.without(_undrawable(view, path, online=online))
        attempt_alone(view.name, _WHAT, lambda: write(view))
    return view.failures


def _undrawable(view: ViewModel, path: Path, *, online: bool) -> list[Failure]:
    """The cells that cannot be drawn alone."""
    tries = Attempts(_WHAT)

    def draw(cell: CellView | CellResult) -> None:
        if isinstance(cell, CellView):
            alone = replace(view, cells=(), cell_views=(cell,))
        else:
            alone = replace(view, cells=(cell,), cell_views=())
        with TemporaryDirectory(dir=path.absolute().parent) as scratch:
            _write(alone, Path(scratch) / "alone.rrd", None, online=online)

    tries.each(view.cell_views, lambda cell: cell.name, draw)
    tries.each(view.cells, lambda cell: cell.cell, draw)
    return list(tries.failures.values())


def _write(view: ViewModel, path: Path, basemap: Basemap | None, *, online: bool) -> None:
    rr.set_strict_mode(True)
    ids = " ".join(walk.run.meta.run_id for walk in view.survey.walks)
    recording = rr.RecordingStream(APPLICATION, recording_id=f"{ids} {view.name}")
    recording.set_log_time_enabled(False)
    recording.save(path)
    # active as well: the layout that the viewer remembers from another run overrides a default
    recording.send_blueprint(layout(view, online=online), make_active=True, make_default=True)
    recording.send_recording_name(view.name)
    writer = RerunWriter(recording, view.survey.clock)
    _draw_texts(writer, view)
    draw_plan(writer, view)
    if basemap is not None:
        draw_basemap(writer, basemap)
    if online:
        draw_map(writer, view)
    draw_series(writer, view)
    draw_states(writer, view)
    recording.flush()
    recording.disconnect()


def _draw_texts(writer: RerunWriter, view: ViewModel) -> None:
    """The report of each detailed cell, or of a run without any."""
    reports = {entity("report", cell.name): cell_report(view, cell) for cell in view.cell_views}
    for path, text in (reports or {"report": empty_report(view)}).items():
        writer.log_static(path, rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN))
    if view.box is None:
        writer.log_static("plan/missing", rr.TextDocument("no position fix"))
