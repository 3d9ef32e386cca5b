"""A run as a recording for the rerun viewer."""

from pathlib import Path

from logger.core.errors import ConfigError

try:
    import rerun as rr
except ImportError as error:
    raise ConfigError("pictures need rerun: install cellwalk[post]") from error

from postproc.pictures.picture import Picture, picture_of
from postproc.pictures.scene_layout import layout
from postproc.pictures.scene_plan import draw_plan
from postproc.pictures.scene_report import report
from postproc.pictures.scene_series import draw_series
from postproc.pictures.scene_sheet import Sheet
from postproc.pictures.viewer import show
from postproc.smooth import Smoothed
from postproc.whole_file import whole_file

APPLICATION = "cellwalk"


def write_scene(smoothed: Smoothed, path: Path) -> None:
    """Write the recording (.rrd) of a run, complete or not at all; raises `RunFileError`."""
    with whole_file(path) as part:
        _write(picture_of(smoothed), part)


def open_viewer(smoothed: Smoothed) -> int:
    """Show a run in the viewer until it is closed; raises `ConfigError` where there is no screen to show it on."""
    return show(lambda path: write_scene(smoothed, path), smoothed.run.path.stem)


def _write(picture: Picture, path: Path) -> None:
    rr.set_strict_mode(True)
    name = f"{picture.run.path.name} {picture.focus.cell}" if picture.focus else picture.run.path.name
    recording = rr.RecordingStream(APPLICATION, recording_id=f"{picture.run.meta.run_id} {name}")
    recording.set_log_time_enabled(False)
    blueprint = layout(picture)
    recording.save(path)
    # active, not only default: a layout the viewer remembers from another run would win over a default
    recording.send_blueprint(blueprint, make_active=True, make_default=True)
    recording.send_recording_name(name)
    sheet = Sheet(recording, picture.clock)
    sheet.always("report", rr.TextDocument(report(picture), media_type=rr.MediaType.MARKDOWN))
    if picture.box is None:
        sheet.always("plan/missing", rr.TextDocument("no position fix"))
    draw_plan(sheet, picture)
    draw_series(sheet, picture)
    recording.flush()
    recording.disconnect()
