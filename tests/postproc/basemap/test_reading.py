"""Images and tiles with a known pattern: every pixel must be at its position."""

import sqlite3
from io import BytesIO

import numpy as np
import pytest
from PIL import Image
from pyproj import CRS, Transformer

from logger.core.errors import ConfigError
from postproc import basemap
from postproc.basemap import MOST_PIXELS
from postproc.view.scene import write_scene
from tests.kit import sample_results as kit
from tests.kit.rerun_recordings import chunks
from tests.kit.sample_view import sample_view

UTM = CRS.from_epsg(32633)
RED, GREEN, BLUE, YELLOW = (200, 40, 40), (40, 200, 40), (40, 40, 200), (200, 200, 40)
QUARTERS = {(0, 0): RED, (0, 1): GREEN, (1, 0): BLUE, (1, 1): YELLOW}
"""By south and east of the centre: red is north-west, yellow south-east."""


@pytest.fixture(scope="module")
def view(tmp_path_factory):
    run = kit.write_run(tmp_path_factory.mktemp("basemap") / "walk.journal", seconds=120, cells=1)
    return sample_view(kit.sample_result(run))


def centre(view, crs):
    """The centre of the plan in a reference system."""
    x, y = view.box.corners_m.mean(axis=0) + view.survey.origin_m
    return Transformer.from_crs(UTM, crs, always_xy=True).transform(x, y)


def quarters(size=64):
    """A picture of four colours."""
    pixels = np.zeros((size, size, 3), np.uint8)
    half = size // 2
    for (south, east), colour in QUARTERS.items():
        pixels[south * half : (south + 1) * half, east * half : (east + 1) * half] = colour
    return Image.fromarray(pixels)


def check(basemap):
    """Each quarter of the plan in its colour."""
    rows, columns = basemap.pixels.shape[:2]
    for (south, east), colour in QUARTERS.items():
        at = basemap.pixels[int((0.4 + 0.2 * south) * rows), int((0.4 + 0.2 * east) * columns)]
        np.testing.assert_allclose(
            at, [*colour, 255], atol=12, err_msg=f"south {south} east {east}"
        )


def read_basemap(path, view):
    return basemap.read_basemap(path, view.survey, view.box)


def mosaic(view, columns=4):
    """Tiles of Web Mercator by (zoom, column, row), coloured by the quarters."""
    crs = CRS.from_epsg(3857)
    world = 2 * np.pi * 6378137.0
    x, y = centre(view, crs)
    tiles = {}
    for zoom in (14, 18):
        side = world / 2**zoom
        left, top = int((x + world / 2) / side), int((world / 2 - y) / side)
        for column in range(left - columns, left + columns + 1):
            for row in range(top - columns, top + columns + 1):
                east = -world / 2 + (column + (np.arange(256) + 0.5) / 256) * side >= x
                south = world / 2 - (row + (np.arange(256) + 0.5) / 256) * side <= y
                colours = np.array(list(QUARTERS.values()), np.uint8)
                tiles[zoom, column, row] = colours[2 * south[:, None] + east[None, :]]
    return tiles


def blob(pixels):
    file = BytesIO()
    Image.fromarray(pixels).save(file, "PNG")
    return file.getvalue()


def mbtiles(path, tiles, *, scheme=None):
    with sqlite3.connect(path) as database:
        database.execute("CREATE TABLE metadata (name text, value text)")
        database.execute(
            "CREATE TABLE tiles (zoom_level int, tile_column int, tile_row int, tile_data blob)"
        )
        if scheme:
            database.execute("INSERT INTO metadata VALUES ('scheme', ?)", (scheme,))
        rows = [
            (zoom, column, row if scheme == "xyz" else 2**zoom - 1 - row, blob(pixels))
            for (zoom, column, row), pixels in tiles.items()
        ]
        database.executemany("INSERT INTO tiles VALUES (?, ?, ?, ?)", rows)
    database.close()
    return path


@pytest.mark.parametrize("scheme", [None, "tms", "xyz"])
def test_mbtiles_count_rows_from_the_south_unless_their_metadata_state_xyz(scheme, view, tmp_path):
    check(read_basemap(mbtiles(tmp_path / "x.mbtiles", mosaic(view), scheme=scheme), view))


def test_missing_tiles_are_transparent(view, tmp_path):
    tiles = mosaic(view)
    fewer = dict(list(tiles.items())[::2])
    basemap = read_basemap(mbtiles(tmp_path / "x.mbtiles", fewer), view)
    assert 0 < np.mean(basemap.pixels[..., 3] > 0) < 1


def test_it_is_drawn_below_the_plan_and_limited_in_size(view, tmp_path):
    basemap = read_basemap(mbtiles(tmp_path / "x.mbtiles", mosaic(view)), view)
    assert max(basemap.pixels.shape) <= MOST_PIXELS
    write_scene(view, tmp_path / "x.rrd", basemap=basemap)
    assert "/plan/ground/basemap" in chunks(tmp_path / "x.rrd")
    assert (tmp_path / "x.rrd").stat().st_size < 3e6


def picture(folder, view):
    """A picture with a position beside it, as earlier versions read."""
    quarters().save(folder / "x.png")
    (folder / "x.pgw").write_text("1 0 0 -1 400000 5800000")
    return folder / "x.png"


def vector_tiles(folder, view):
    path = mbtiles(folder / "x.mbtiles", mosaic(view))
    with sqlite3.connect(path) as database:
        database.execute("UPDATE tiles SET tile_data = 'pbf'")
    database.close()
    return path


def far_tiles(folder, view):
    return mbtiles(folder / "x.mbtiles", {(14, 1, 1): np.zeros((256, 256, 3), np.uint8)})


def another_database(folder, view):
    with sqlite3.connect(folder / "x.db") as database:
        database.execute("CREATE TABLE x (y)")
    database.close()
    return folder / "x.db"


@pytest.mark.parametrize(
    ("make_file", "reason"),
    [
        (picture, "gdal_translate -of MBTILES"),
        (vector_tiles, "vector"),
        (far_tiles, "does not cover"),
        (another_database, "no MBTiles file"),
        (lambda folder, view: folder / "absent.png", "no such file"),
    ],
)
def test_an_unusable_file_is_one_line(make_file, reason, view, tmp_path):
    with pytest.raises(ConfigError, match=reason):
        read_basemap(make_file(tmp_path, view), view)


def test_without_a_plan_there_is_no_ground(tmp_path, view):
    from dataclasses import replace

    path = mbtiles(tmp_path / "x.mbtiles", mosaic(view))
    assert read_basemap(path, replace(view, box=None)) is None
