"""The walk on a map of the world, whose tiles come from the network.

A map view of rerun has neither ellipses nor filled areas.
"""

from math import cos, log2, radians

import numpy as np
import rerun as rr

from postproc.pictures import colours
from postproc.view.layers import FARTHEST_M, draw_levels, draw_posterior, draw_walks
from postproc.view.rerun_writer import RerunWriter, on_screen
from postproc.view.surface import Style, Surface
from postproc.view.view_model import CellView, ViewModel

_MOST_POINTS = 5_000
"""With more points the map view becomes slow."""
_MAP_PIXELS, _TILE_PIXELS = 700, 256
"""Size of the map view in a window of usual size, and of a tile of Web Mercator."""
_EQUATOR_M = 40_075_017.0
_MOST_ZOOM = 18.0
"""OpenStreetMap has no tiles beyond 19."""


def draw_map(writer: RerunWriter, view: ViewModel) -> None:
    """Walks, and for each cell shown in detail its levels, regions and positions."""
    if view.box is None:
        return
    surface = Surface(
        writer, "map", is_plan=False, most_points=_MOST_POINTS, convert=view.survey.degrees
    )
    # the map centres on what is visible at the moment: an invisible frame keeps it in place
    corners = view.survey.degrees(view.box.corners_m)
    frame = rr.GeoPoints(lat_lon=corners, colors=[(0, 0, 0, 0)], radii=on_screen(0.1))
    surface.log_static(("frame",), frame)
    draw_walks(surface, view)
    for cell in view.cell_views:
        draw_levels(surface, cell)
        draw_posterior(surface, view, cell)
        _draw_marks(surface, view, cell)


def zoom_of(view: ViewModel) -> float:
    """Web Mercator zoom at which the plan's box fills the map view."""
    box = view.box
    if box is None:
        return 1.0
    lat_deg = float(view.survey.degrees(box.corners_m)[:, 0].mean())
    around_m = _EQUATOR_M * cos(radians(lat_deg))
    return min(log2(around_m / max(box.size, 1.0) * _MAP_PIXELS / _TILE_PIXELS), _MOST_ZOOM)


def _draw_marks(surface: Surface, view: ViewModel, cell: CellView) -> None:
    """The final position of every estimator, the truth of a simulation, and claims."""
    marks = [
        (estimate.x[:2], colours.ESTIMATORS[estimate.estimator.key])
        for estimate in cell.picture.estimates
    ]
    if cell.picture.truth_m is not None:
        marks.append((np.array(cell.picture.truth_m), colours.TRUTH))
    for tested in cell.claims:
        position_m = view.survey.position_m(tested.claim.lat_deg, tested.claim.lon_deg)
        marks.append((position_m, colours.verdict_colour(tested.verdict)))
    near = [(position_m, ink) for position_m, ink in marks if np.hypot(*position_m) < FARTHEST_M]
    if near:
        positions_m, inks = zip(*near, strict=True)
        surface.points(("cells", cell.name, "marks"), np.array(positions_m), Style(inks, 4.0))
