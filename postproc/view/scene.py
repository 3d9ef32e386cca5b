"""A story as a recording for the rerun viewer."""

from pathlib import Path

import rerun as rr

from postproc.atomic_write import whole_file
from postproc.view.basemap import Basemap, draw_basemap
from postproc.view.blueprint import layout
from postproc.view.plan import draw_plan
from postproc.view.rerun_writer import Sheet, entity
from postproc.view.series import draw_series
from postproc.view.states import draw_states
from postproc.view.summary_text import report, report_of_nothing
from postproc.view.view_model import Story
from postproc.view.world_map import draw_map

APPLICATION = "cellwalk"


def write_scene(
    story: Story, path: Path, *, basemap: Basemap | None = None, online: bool = True
) -> None:
    """Write the recording (.rrd), complete or not at all; raises `RunFileError`.

    `online` is as in `layout`.
    """
    with whole_file(path) as part:
        _write(story, part, basemap, online=online)


def _write(story: Story, path: Path, basemap: Basemap | None, *, online: bool) -> None:
    rr.set_strict_mode(True)
    ids = " ".join(walk.run.meta.run_id for walk in story.walks)
    recording = rr.RecordingStream(APPLICATION, recording_id=f"{ids} {story.name}")
    recording.set_log_time_enabled(False)
    recording.save(path)
    # active, not only default: a layout the viewer remembers from another run would win over a
    # default
    recording.send_blueprint(layout(story, online=online), make_active=True, make_default=True)
    recording.send_recording_name(story.name)
    sheet = Sheet(recording, story.clock)
    _draw_words(sheet, story)
    draw_plan(sheet, story)
    if basemap is not None:
        draw_basemap(sheet, basemap)
    if online:
        draw_map(sheet, story)
    draw_series(sheet, story)
    draw_states(sheet, story)
    recording.flush()
    recording.disconnect()


def _draw_words(sheet: Sheet, story: Story) -> None:
    """The report of each cell told in full, or of a run without any."""
    markdown = rr.MediaType.MARKDOWN
    for subject in story.subjects:
        text = rr.TextDocument(report(story, subject), media_type=markdown)
        sheet.always(entity("report", subject.cell), text)
    if not story.subjects:
        sheet.always("report", rr.TextDocument(report_of_nothing(story), media_type=markdown))
    if story.box is None:
        sheet.always("plan/missing", rr.TextDocument("no position fix"))
