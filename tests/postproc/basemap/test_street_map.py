from postproc.basemap.vector_tile import draw_tile, layers_of
from tests.kit.vector_tiles import feature, layer

SQUARE = [(0, 0), (2000, 0), (2000, 2000), (0, 2000)]
HOLE = [(500, 500), (500, 1500), (1500, 1500), (1500, 500)]


def test_water_with_an_island_and_a_street(tmp_path):
    street = feature("line", [[(3000, 0), (3000, 4096)]], [0, 0])
    tile = layer("water", [feature("polygon", [SQUARE, HOLE])])
    tile += layer("roads", [street], ["kind"], ["major_road"])
    picture = draw_tile(layers_of(tile), 512)
    paper = picture.getpixel((450, 400))
    assert picture.getpixel((30, 30)) != paper  # water
    assert picture.getpixel((125, 125)) == paper  # the island
    assert picture.getpixel((375, 300)) not in {paper, picture.getpixel((30, 30))}


def test_layers_of_another_schema_and_unknown_ones():
    tile = layer("transportation", [feature("line", [[(0, 2048), (4096, 2048)]])])
    tile += layer("somewhere", [feature("point", [[(1, 1)]])])
    picture = draw_tile(layers_of(tile), 256)
    assert picture.getpixel((128, 128)) != picture.getpixel((128, 20))
