"""The same on a map of the world: it needs a network for its tiles, and has neither ellipse nor
polygon.
"""

from math import cos, log2, radians

import numpy as np
import rerun as rr

from postproc.pictures import colours
from postproc.pictures.picture import Box
from postproc.view.ground import colour_of_verdict
from postproc.view.plan import FARTHEST_M, MOST_STRIPS, REGION_WIDTHS, strips_of
from postproc.view.rerun_writer import Sheet, entity, points, thinned
from postproc.view.view_model import Story, Subject

_MOST_FIXES = 5_000
_MAP_PIXELS, _TILE_PIXELS = 700, 256
_EQUATOR_M = 40_075_017.0
_MOST_ZOOM = 18.0


def draw_map(sheet: Sheet, story: Story) -> None:
    """Walks, walker, and for each cell told in full its region and places as they came about."""
    if story.utm is None or story.box is None:
        return
    box = story.box
    corners = story.degrees(
        np.array([(x, y) for x in (box.west, box.east) for y in (box.south, box.north)])
    )
    # the map centres on what is visible now: an unseen frame keeps it where it is
    sheet.always(
        "map/frame", rr.GeoPoints(lat_lon=corners, colors=[(0, 0, 0, 0)], radii=points(0.1))
    )
    style = rr.GeoPoints.from_fields(colors=[colours.WALKER], radii=points(7.0))
    sheet.always("map/walker", style)
    for walk in story.walks:
        strips = [story.degrees(strip) for strip in strips_of(walk.t_ns, walk.track_m)]
        if strips:
            drawn = rr.GeoLineStrings(lat_lon=strips, colors=[colours.QUIET], radii=points(1.5))
            sheet.always(entity("map", "walks", walk.name, "track"), drawn)
        part = thinned(len(walk.t_ns), _MOST_FIXES)
        if len(walk.t_ns):
            places = rr.GeoPoints.columns(positions=story.degrees(walk.track_m[part]))
            sheet.over_time("map/walker", walk.t_ns[part], places)
    for subject in story.subjects:
        _subject(sheet, story, subject)


def zoom_of(story: Story) -> float:
    """Web Mercator zoom at which the plan's box fills the view."""
    box: Box | None = story.box
    if story.utm is None or box is None:
        return 1.0
    middle = story.degrees(np.array([[0.5 * (box.west + box.east), 0.5 * (box.south + box.north)]]))
    around_m = _EQUATOR_M * cos(radians(float(middle[0, 0])))
    return min(log2(around_m / max(box.size, 1.0) * _MAP_PIXELS / _TILE_PIXELS), _MOST_ZOOM)


def _subject(sheet: Sheet, story: Story, subject: Subject) -> None:
    obs, picture = subject.result.obs, subject.picture
    if obs is not None and len(obs):
        part = thinned(len(obs), MOST_STRIPS)
        rgb = colours.of_levels(picture.heard_dbm[part], *picture.strength_dbm)
        heard = rr.GeoPoints(
            lat_lon=story.degrees(picture.heard_m[part]), colors=rgb, radii=points(3.0)
        )
        sheet.always(entity("map", "cells", subject.cell, "levels"), heard)
    _others(sheet, story, subject)
    if not subject.steps:
        return
    times = np.array([step.t_ns for step in subject.steps])
    for (name, by_step), width in zip(subject.regions.items(), REGION_WIDTHS, strict=True):
        path = entity("map", "cells", subject.cell, f"region{name}")
        sheet.always(
            path,
            rr.GeoLineStrings.from_fields(colors=[colours.POSTERIOR], radii=points(0.75 * width)),
        )
        columns = rr.GeoLineStrings.columns(
            line_strings=[story.degrees(ring) for rings in by_step for ring in rings]
        )
        sheet.over_time(path, times, columns.partition([len(rings) for rings in by_step]))
    path = entity("map", "cells", subject.cell, "places")
    sheet.always(path, rr.GeoPoints.from_fields(colors=[colours.POSTERIOR], radii=points(6.0)))
    modes = [mode for step in subject.steps for mode in step.posterior.modes]
    places = story.local(
        np.array([mode.x_m for mode in modes]), np.array([mode.y_m for mode in modes])
    )
    found = rr.GeoPoints.columns(positions=story.degrees(places))
    sheet.over_time(
        path, times, found.partition([len(step.posterior.modes) for step in subject.steps])
    )


def _others(sheet: Sheet, story: Story, subject: Subject) -> None:
    """The last word of every estimator, the truth of a simulation, and claims."""
    marks = [(estimate.x[:2], estimate.colour) for estimate in subject.picture.estimates]
    if subject.picture.truth_m is not None:
        marks.append((np.array(subject.picture.truth_m), colours.TRUTH))
    for one in subject.claims:
        place = story.place_of(one.claim.lat_deg, one.claim.lon_deg)
        if place is not None:
            marks.append((place, colour_of_verdict(one.verdict)))
    near = [(place, ink) for place, ink in marks if np.hypot(*place) < FARTHEST_M]
    if near:
        places, inks = zip(*near, strict=True)
        drawn = rr.GeoPoints(
            lat_lon=story.degrees(np.array(places)), colors=inks, radii=points(5.0)
        )
        sheet.always(entity("map", "cells", subject.cell, "estimates"), drawn)
