"""What the plan and the map of the world both show: walks, levels, regions and likely positions."""

from postproc.pictures import colours
from postproc.pictures.geometry import evenly_spaced
from postproc.pictures.picture import mode_label
from postproc.view.surface import Style, Surface
from postproc.view.view_model import CellView, ViewModel

MOST_STRIPS = 5_000
"""With more strips in one entity the viewer becomes slow."""
FARTHEST_M = 1e6
"""A diverged filter beyond this cannot be drawn in single precision, and shows nothing."""

_REGION_RADII = {"95": 0.75, "50": 1.25}


def draw_walks(surface: Surface, view: ViewModel) -> None:
    """The tracks in grey, and the walker at the time of the cursor."""
    for walk in view.survey.walks:
        strips = [strip for strip in walk.strips_m if len(strip) > 1]
        track = [strips[i] for i in evenly_spaced(len(strips), MOST_STRIPS)]
        grey = Style([(*colours.QUIET, 160)], 1.0, 0.0)
        surface.lines(("walks", walk.name, "track"), track, grey)
        shown = evenly_spaced(len(walk.t_ns), surface.most_points)
        style = Style([colours.WALKER], 7.0, 30.0)
        surface.points_over_time(("walker",), walk.t_ns[shown], walk.track_m[shown], style)


def draw_levels(surface: Surface, cell: CellView) -> None:
    """The readings of a cell in the colours of their levels."""
    picture = cell.picture
    shown = evenly_spaced(len(picture.level_dbm), surface.most_points)
    if len(shown):
        inks = colours.level_colours(picture.level_dbm[shown], *picture.level_range_dbm)
        path = ("cells", cell.name, "levels")
        surface.points(path, picture.readings_m[shown], Style(inks, 2.5, 5.0))


def draw_posterior(surface: Surface, view: ViewModel, cell: CellView) -> None:
    """The regions that contain 95 % and 50 % of the probability, and the modes, step by step."""
    if not cell.steps:
        return
    path = ("cells", cell.name, "posterior")
    for share, radius in _REGION_RADII.items():
        style = Style([colours.POSTERIOR], radius, 10.0)
        rings = [regions[share] for regions in cell.regions]
        surface.lines_over_time((*path, f"region{share}"), cell.t_ns, rings, style)
    posteriors = [step.posterior for step in cell.steps]
    positions_m = view.survey.modes_m([mode for one in posteriors for mode in one.modes])
    counts = [len(posterior.modes) for posterior in posteriors]
    labels = [mode_label(posterior, mode) for posterior in posteriors for mode in posterior.modes]
    if surface.is_plan:
        rim = Style([colours.PAPER], 7.0, 19.0)
        surface.points_over_time((*path, "modes", "rim"), cell.t_ns, positions_m, rim, counts)
    style = Style([colours.POSTERIOR], 5.0, 20.0)
    surface.points_over_time((*path, "modes"), cell.t_ns, positions_m, style, counts, labels=labels)
