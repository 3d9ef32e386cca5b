"""Points and lines on one of two surfaces: the plan in local metres, or the map of the world.

Positions come in local metres and paths without the name of the surface, so that both show the same
by the same code. The map has no drawing order and no labels; they are left out there.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import rerun as rr

from logger.core.arrays import FloatArray, IntArray
from postproc.pictures.colours import Bytes
from postproc.view.rerun_writer import Ink, RerunWriter, entity, on_screen

_ON_A_MAP = 1.25
"""Radii on a map, relative to the plan: its ground is light and full of detail."""


class Style(NamedTuple):
    """Colours of the marks, or one for all; radius on screen; a larger `order` is drawn above."""

    inks: Sequence[Ink] | Bytes
    radius: float
    order: float = 20.0


class Surface(NamedTuple):
    """`convert` turns local metres (n, 2) into positions of the surface."""

    writer: RerunWriter
    name: str
    is_plan: bool
    most_points: int
    convert: Callable[[FloatArray], FloatArray]

    def points(
        self, path: Sequence[str], positions_m: FloatArray, style: Style, **labels: Any
    ) -> None:
        """Static points (n, 2)."""
        fields = self._point_fields(positions_m, labels) | self._style(style)
        self.log_static(path, self._points.from_fields(**fields))

    def lines(self, path: Sequence[str], strips_m: Sequence[FloatArray], style: Style) -> None:
        """Static strips (k, 2); without one there is no entity."""
        if strips_m:
            fields = self._strip_fields(strips_m) | self._style(style)
            self.log_static(path, self._lines.from_fields(**fields))

    def points_over_time(
        self,
        path: Sequence[str],
        t_ns: IntArray,
        positions_m: FloatArray,
        style: Style,
        counts: Sequence[int] | None = None,
        **labels: Any,
    ) -> None:
        """A point for each time, or `counts` of them; `labels` (n,) change with the points."""
        shown = {"show_labels": True} if labels and self.is_plan else {}
        self.log_static(path, self._points.from_fields(**self._style(style), **shown))
        columns = self._points.columns(**self._point_fields(positions_m, labels))
        self.send_columns(path, t_ns, columns if counts is None else columns.partition(counts))

    def lines_over_time(
        self,
        path: Sequence[str],
        t_ns: IntArray,
        strips_m: Sequence[Sequence[FloatArray]],
        style: Style,
    ) -> None:
        """Several strips (k, 2) for each time."""
        self.log_static(path, self._lines.from_fields(**self._style(style)))
        flat = [strip for strips in strips_m for strip in strips]
        columns = self._lines.columns(**self._strip_fields(flat))
        self.send_columns(path, t_ns, columns.partition([len(strips) for strips in strips_m]))

    def log_static(self, path: Sequence[str], *archetypes: Any) -> None:
        """As `RerunWriter.log_static`."""
        self.writer.log_static(entity(self.name, *path), *archetypes)

    def send_columns(self, path: Sequence[str], t_ns: IntArray, *columns: Any) -> None:
        """As `RerunWriter.send_columns`."""
        self.writer.send_columns(entity(self.name, *path), t_ns, *columns)

    @property
    def _points(self) -> Any:
        return rr.Points2D if self.is_plan else rr.GeoPoints

    @property
    def _lines(self) -> Any:
        return rr.LineStrips2D if self.is_plan else rr.GeoLineStrings

    def _point_fields(self, positions_m: FloatArray, labels: dict[str, Any]) -> dict[str, Any]:
        positions = self.convert(np.asarray(positions_m, float))
        return {"positions": positions} | (labels if self.is_plan else {})

    def _strip_fields(self, strips_m: Sequence[FloatArray]) -> dict[str, Any]:
        return {"strips" if self.is_plan else "line_strings": [self.convert(s) for s in strips_m]}

    def _style(self, style: Style) -> dict[str, Any]:
        if self.is_plan:
            return {
                "colors": style.inks,
                "radii": on_screen(style.radius),
                "draw_order": style.order,
            }
        return {"colors": style.inks, "radii": on_screen(_ON_A_MAP * style.radius)}
