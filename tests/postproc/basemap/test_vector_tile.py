from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from postproc.basemap import Feature, layers_of
from tests.kit.vector_tiles import feature, layer

SQUARE = [(0, 0), (10, 0), (10, 10), (0, 10)]


def test_features_keep_their_points_and_tags():
    lines = feature("line", [[(5, 6), (4000, -7)], [(1, 1), (2, 2), (3, 1)]], [0, 1])
    area = feature("polygon", [SQUARE, [(2, 2), (2, 4), (4, 4)]])
    (roads, water) = layers_of(
        layer("roads", [lines], ["name"], ["x", "Große Straße"]) + layer("water", [area])
    )
    assert (roads.name, roads.extent, water.name) == ("roads", 4096, "water")
    assert roads.features == [
        Feature("line", [[(5, 6), (4000, -7)], [(1, 1), (2, 2), (3, 1)]], {"name": "Große Straße"})
    ]
    assert water.features[0].parts == [SQUARE, [(2, 2), (2, 4), (4, 4)]]


def test_a_tile_that_is_cut_short_is_an_error():
    data = layer("roads", [feature("line", [[(5, 6), (4000, -7)]])])
    with pytest.raises(ValueError, match="no vector tile"):
        layers_of(data[:-3])


@given(st.binary(max_size=200))
def test_any_bytes_are_layers_or_an_error(data):
    with suppress(ValueError):
        layers_of(data)
