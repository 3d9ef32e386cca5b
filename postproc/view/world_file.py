"""Pictures with a world file: six numbers that say where their pixels are, but not in which
reference system.

Its lines are the factors of column and row for x and y, then the place of the middle of the first
pixel: x = line1 column + line3 row + line5, y = line2 column + line4 row + line6.
"""

import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from PIL import Image, UnidentifiedImageError
from pyproj import CRS
from pyproj.exceptions import CRSError

from logger.core.arrays import FloatArray
from logger.core.errors import ConfigError
from postproc.view.georeferenced import Area, Ground, pixel_of

GEOGRAPHIC = CRS.from_epsg(4326)
WEB_MERCATOR = CRS.from_epsg(3857)


def open_picture(path: Path, area: Area) -> Ground:
    """The part of a picture that covers an area; raises `ConfigError`.

    The reference system is that of a .prj file beside it; without one it is the first of the walk's
    UTM zone, degrees and Web Mercator in which the picture and the walk meet.
    """
    affine = _affine(path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            with Image.open(path) as picture:
                return _part(picture, affine, path, area)
    except (Image.DecompressionBombWarning, Image.DecompressionBombError) as error:
        raise ConfigError(
            f"{path} has more pixels than can be held: cut out what the walk needs"
        ) from error
    except UnidentifiedImageError as error:
        raise ConfigError(
            f"{path} is no picture: PNG or JPEG with a world file, GeoPackage or MBTiles"
        ) from error
    except (OSError, SyntaxError, ValueError) as error:
        raise ConfigError(
            f"{path} cannot be read: {getattr(error, 'strerror', None) or error}"
        ) from error


def _part(picture: Image.Image, affine: FloatArray, path: Path, area: Area) -> Ground:
    """Cut out what is needed, no finer than needed."""
    for crs in _systems(path, area):
        column, row = pixel_of(affine, area.within(crs))
        if not (np.all(np.isfinite(column)) and np.all(np.isfinite(row))):
            continue
        left, top = max(int(column.min()) - 1, 0), max(int(row.min()) - 1, 0)
        right, bottom = (
            min(int(column.max()) + 2, picture.width),
            min(int(row.max()) + 2, picture.height),
        )
        if left < right and top < bottom:
            break
    else:
        raise ConfigError(
            f"{path} and the walk do not meet: place it in the walk's UTM zone, in degrees or in Web Mercator, "
            "or put a .prj file beside it"
        )
    wanted = np.ptp(area.mesh, axis=(1, 2)) / area.finest_m
    factor = max(int(np.hypot(np.ptp(column), np.ptp(row)) / np.hypot(*wanted)), 1)
    pixels = np.asarray(picture.crop((left, top, right, bottom)).convert("RGBA").reduce(factor))
    # of a pixel made of several the middle lies half of the others further on
    half = 0.5 * (factor - 1)
    first = affine @ np.array([left + half, top + half, 1.0])
    return Ground(pixels, crs, np.column_stack([affine[:, :2] * factor, first]))


def _systems(path: Path, area: Area) -> Iterator[CRS]:
    told = path.with_suffix(".prj")
    if told.is_file():
        try:
            yield CRS.from_user_input(told.read_text(errors="replace").strip())
        except CRSError as error:
            raise ConfigError(f"{told} names no reference system that is known") from error
        return
    yield from (area.crs, GEOGRAPHIC, WEB_MERCATOR)


def _affine(path: Path) -> FloatArray:
    suffix = path.suffix
    short = f".{suffix[1:2]}{suffix[-1:]}w"
    names = [path.with_suffix(end) for end in (short, short.upper(), f"{suffix}w", ".wld", ".WLD")]
    world = next((name for name in names if name.is_file()), None)
    if world is None:
        raise ConfigError(
            f"{path} has no world file beside it ({names[0].name} or {path.stem}.wld)"
        )
    try:
        a, d, b, e, x, y = (
            float(word.replace(",", ".")) for word in world.read_text(errors="replace").split()
        )
    except ValueError as error:
        raise ConfigError(f"{world} is no world file: six numbers are wanted") from error
    affine = np.array([[a, b, x], [d, e, y]])
    if not np.all(np.isfinite(affine)) or np.linalg.det(affine[:, :2]) == 0.0:
        raise ConfigError(f"{world} says that the picture has no size")
    return affine
