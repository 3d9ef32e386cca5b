"""Images and tiles with a known pattern: every pixel must be at its position."""

import sqlite3
from io import BytesIO

import numpy as np
import pytest
from PIL import Image
from pyproj import CRS, Transformer

from logger.core.errors import ConfigError
from postproc.basemap import reading
from postproc.basemap.reading import MOST_PIXELS
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


def picture(folder, view, crs, unit, *, name="ground.png", world="ground.pgw", span_m=500.0):
    """Four quarters around the centre of the plan."""
    image, (x, y) = quarters(), centre(view, crs)
    image.save(folder / name)
    side = span_m * unit / image.width
    first = x - 0.5 * (image.width - 1) * side, y + 0.5 * (image.height - 1) * side
    (folder / world).write_text(
        "\n".join(f"{v!r}" for v in (side, 0.0, 0.0, -side, *map(float, first)))
    )
    return folder / name


def read_basemap(path, view):
    return reading.read_basemap(path, view.survey, view.box)


DEGREE = 1.0 / 70_000


@pytest.mark.parametrize(
    ("crs", "unit", "name", "world"),
    [
        (UTM, 1.0, "ground.png", "ground.pgw"),
        (UTM, 1.0, "ground.jpg", "ground.jgw"),
        (UTM, 1.0, "ground.jpeg", "ground.jpegw"),
        (CRS.from_epsg(4326), DEGREE, "ground.png", "ground.wld"),
        (CRS.from_epsg(3857), 1.6, "ground.png", "ground.PGW"),
    ],
    ids=["UTM", "JPEG", "long name", "degrees", "Web Mercator"],
)
def test_a_picture_with_a_world_file(crs, unit, name, world, view, tmp_path):
    check(read_basemap(picture(tmp_path, view, crs, unit, name=name, world=world), view))


def test_a_turned_picture(view, tmp_path):
    path, (x, y) = tmp_path / "ground.png", centre(view, UTM)
    quarters().rotate(-90).save(path)  # north is to the right of it
    side = 30.0
    first = x - 31.5 * side, y - 31.5 * side
    (tmp_path / "ground.pgw").write_text(f"0 {side} {side} 0 {first[0]} {first[1]}")
    check(read_basemap(path, view))


def test_a_prj_file_sets_the_reference_system(view, tmp_path):
    path = picture(tmp_path, view, CRS.from_epsg(25833), 1.0)
    (tmp_path / "ground.prj").write_text(CRS.from_epsg(25833).to_wkt())
    check(read_basemap(path, view))
    (tmp_path / "ground.prj").write_text("somewhere")
    with pytest.raises(ConfigError, match="no known reference system"):
        read_basemap(path, view)


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
    basemap = read_basemap(picture(tmp_path, view, UTM, 1.0), view)
    assert max(basemap.pixels.shape) <= MOST_PIXELS
    write_scene(view, tmp_path / "x.rrd", basemap=basemap)
    assert "/plan/ground/basemap" in chunks(tmp_path / "x.rrd")
    assert (tmp_path / "x.rrd").stat().st_size < 3e6


def test_a_fine_image_is_reduced(view, tmp_path):
    side_m = view.box.size * 1.4 / 3000
    Image.effect_noise((3000, 3000), 50.0).save(tmp_path / "x.png")
    x, y = centre(view, UTM)
    (tmp_path / "x.pgw").write_text(
        f"{side_m} 0 0 {-side_m} {x - 1500 * side_m} {y + 1500 * side_m}"
    )
    basemap = read_basemap(tmp_path / "x.png", view)
    assert max(basemap.pixels.shape) <= MOST_PIXELS
    assert np.all(basemap.pixels[..., 3] == 255)


def no_world_file(folder, view):
    quarters().save(folder / "x.png")
    return folder / "x.png"


def bad_world_file(folder, view):
    (folder / "x.pgw").write_text("1 0 0 north")
    return no_world_file(folder, view)


def flat_world_file(folder, view):
    (folder / "x.pgw").write_text("0 0 0 0 1 1")
    return no_world_file(folder, view)


def far_away(folder, view):
    (folder / "x.pgw").write_text("1 0 0 -1 900000 7000000")
    return no_world_file(folder, view)


def no_picture(folder, view):
    (folder / "x.pgw").write_text("1 0 0 -1 0 0")
    (folder / "x.png").write_text("hello")
    return folder / "x.png"


def cut_picture(folder, view):
    path = picture(folder, view, UTM, 1.0)
    path.write_bytes(path.read_bytes()[:120])
    return path


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
        (no_world_file, "no world file"),
        (bad_world_file, "six numbers"),
        (flat_world_file, "no size"),
        (far_away, "does not overlap"),
        (no_picture, "is not an image"),
        (cut_picture, "cannot be read"),
        (vector_tiles, "vector"),
        (far_tiles, "does not cover"),
        (another_database, "no MBTiles file"),
        (lambda folder, view: folder / "absent.png", "no world file"),
    ],
)
def test_an_unusable_file_is_one_line(make_file, reason, view, tmp_path):
    with pytest.raises(ConfigError, match=reason):
        read_basemap(make_file(tmp_path, view), view)


def test_without_a_plan_there_is_no_ground(tmp_path, view):
    from dataclasses import replace

    assert read_basemap(picture(tmp_path, view, UTM, 1.0), replace(view, box=None)) is None
