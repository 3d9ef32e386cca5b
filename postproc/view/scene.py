"""A view model as a recording for the rerun viewer."""

from pathlib import Path

import rerun as rr

from postproc.atomic_write import whole_file
from postproc.basemap.reading import Basemap
from postproc.view.basemap import draw_basemap
from postproc.view.blueprint import layout
from postproc.view.plan import draw_plan
from postproc.view.rerun_writer import RerunWriter, entity
from postproc.view.series import draw_series
from postproc.view.states import draw_states
from postproc.view.summary_text import cell_report, empty_report
from postproc.view.view_model import ViewModel
from postproc.view.world_map import draw_map

APPLICATION = "cellwalk"


def write_scene(
    view: ViewModel, path: Path, *, basemap: Basemap | None = None, online: bool = True
) -> None:
    """Write the recording (.rrd), complete or not at all; raises `RunFileError`.

    `online` is as in `layout`.
    """
    with whole_file(path) as part:
        _write(view, part, basemap, online=online)


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
