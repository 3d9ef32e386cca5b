"""Images with a world file: six numbers that position the pixels, without a reference system.

The lines are the factors of column and row for x and y, then the centre of the first pixel:
x = line1 column + line3 row + line5, y = line2 column + line4 row + line6.
"""

import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image, UnidentifiedImageError
from pyproj import CRS
from pyproj.exceptions import CRSError

from logger.core.arrays import FloatArray
from logger.core.errors import ConfigError, FieldLoggerError
from logger.core.foreign import open_regular
from postproc.basemap.georeferenced import Area, Ground, pixel_of
from postproc.foreign_file import MOST_PIXELS

GEOGRAPHIC = CRS.from_epsg(4326)
WEB_MERCATOR = CRS.from_epsg(3857)
_FORMATS = ("PNG", "JPEG", "WEBP", "TIFF", "BMP", "GIF")
"""Pillow would start other programs for some formats."""
_STRIP_ROWS = 512
_MOST_TEXT_BYTES = 64 << 10
"""Of a world file or a reference system, which has some kilobytes."""


class _Crop(NamedTuple):
    """Part of an image, in pixels, and the distance across it in pixels."""

    crs: CRS
    corners: tuple[int, int, int, int]
    diagonal: float


def open_picture(path: Path, area: Area) -> Ground:
    """The part of an image that covers an area; raises `ConfigError`.

    The reference system is that of a .prj file of the same name. Without one it is the first of the
    walk's UTM zone, degrees and Web Mercator in which image and walk overlap.
    """
    affine = _affine(path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            with open_regular(path) as file, Image.open(file, formats=_FORMATS) as picture:
                return _read_part(picture, affine, path, area)
    except (Image.DecompressionBombWarning, Image.DecompressionBombError) as error:
        raise ConfigError(f"{path} has too many pixels: crop it to the area of the walk") from error
    except UnidentifiedImageError as error:
        raise ConfigError(
            f"{path} is not an image: use PNG or JPEG with a world file, PMTiles or MBTiles"
        ) from error
    except FieldLoggerError:
        raise
    except Exception as error:  # whatever Pillow makes of a damaged picture
        reason = getattr(error, "strerror", None) or error
        raise ConfigError(f"{path} cannot be read: {reason}") from error


def _read_part(picture: Image.Image, affine: FloatArray, path: Path, area: Area) -> Ground:
    """Crop to the area, and reduce to the resolution of the plan."""
    if picture.width * picture.height > MOST_PIXELS:
        raise Image.DecompressionBombError
    crop = _crop(picture, affine, path, area)
    wanted = float(np.hypot(*np.ptp(area.mesh, axis=(1, 2)))) / area.finest_m
    factor = max(int(crop.diagonal / wanted), 1)
    left, top, right, bottom = crop.corners
    height = factor * max(_STRIP_ROWS // factor, 1)
    # strip by strip: a copy of the whole picture would take as much memory again
    strips = [
        np.asarray(
            picture.crop((left, first, right, min(first + height, bottom)))
            .convert("RGBA")
            .reduce(factor)
        )
        for first in range(top, bottom, height)
    ]
    pixels = np.concatenate(strips)
    # the centre of a pixel made of n x n is (n - 1) / 2 pixels farther on
    half = 0.5 * (factor - 1)
    first = affine @ np.array([left + half, top + half, 1.0])
    return Ground(pixels, crop.crs, np.column_stack([affine[:, :2] * factor, first]))


def _crop(picture: Image.Image, affine: FloatArray, path: Path, area: Area) -> _Crop:
    for crs in _systems(path, area):
        column, row = pixel_of(affine, area.within(crs))
        if not (np.all(np.isfinite(column)) and np.all(np.isfinite(row))):
            continue
        left, right = max(int(column.min()) - 1, 0), min(int(column.max()) + 2, picture.width)
        top, bottom = max(int(row.min()) - 1, 0), min(int(row.max()) + 2, picture.height)
        if left < right and top < bottom:
            diagonal = float(np.hypot(np.ptp(column), np.ptp(row)))
            return _Crop(crs, (left, top, right, bottom), diagonal)
    raise ConfigError(
        f"{path} does not overlap the walk: use the walk's UTM zone, degrees or Web Mercator, "
        "or add a .prj file of the same name"
    )


def _systems(path: Path, area: Area) -> Iterator[CRS]:
    projection = path.with_suffix(".prj")
    if projection.is_file():
        try:
            yield CRS.from_user_input(_text(projection).strip())
        except CRSError as error:
            raise ConfigError(f"{projection} contains no known reference system") from error
        return
    yield from (area.crs, GEOGRAPHIC, WEB_MERCATOR)


def _text(path: Path) -> str:
    """Text of a small file; raises `ConfigError`."""
    try:
        with open_regular(path) as file:
            data = file.read(_MOST_TEXT_BYTES + 1)
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from error
    if len(data) > _MOST_TEXT_BYTES:
        raise ConfigError(f"{path} has more than {_MOST_TEXT_BYTES >> 10} kB")
    return data.decode("utf-8", "replace")


def _affine(path: Path) -> FloatArray:
    suffix = path.suffix
    short = f".{suffix[1:2]}{suffix[-1:]}w"
    names = [path.with_suffix(end) for end in (short, short.upper(), f"{suffix}w", ".wld", ".WLD")]
    world = next((name for name in names if name.is_file()), None)
    if world is None:
        expected = f"{names[0].name} or {path.stem}.wld"
        raise ConfigError(f"{path} has no world file beside it ({expected})")
    words = _text(world).replace(",", ".").split()
    try:
        affine = np.array(words, float).reshape(3, 2).T
    except ValueError as error:
        raise ConfigError(f"{world} is not a world file: it must contain six numbers") from error
    if not np.all(np.isfinite(affine)) or np.linalg.det(affine[:, :2]) == 0.0:
        raise ConfigError(f"{world} gives the image no size")
    return affine
