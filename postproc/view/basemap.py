"""A picture of the ground under the plan of the viewer."""

import rerun as rr

from postproc.basemap.reading import Basemap
from postproc.view.ground import PAPER
from postproc.view.rerun_writer import RerunWriter

_ORDER = -25.0
"""Below the density and everything else."""
_OPACITY = 0.3
"""Dark enough for what glows on it."""


def draw_basemap(writer: RerunWriter, basemap: Basemap) -> None:
    """Below everything else on the plan."""
    rows, columns = basemap.pixels.shape[:2]
    box = basemap.box
    picture = rr.EncodedImage(
        contents=basemap.jpeg(PAPER), media_type="image/jpeg", opacity=_OPACITY, draw_order=_ORDER
    )
    corner = rr.Transform3D(
        translation=(box.west, box.north, 0.0),
        scale=(box.width / columns, -box.height / rows, 1.0),
    )
    writer.log_static("plan/ground/basemap", picture, corner)
