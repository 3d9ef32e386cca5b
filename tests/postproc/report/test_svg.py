import re

import matplotlib as mpl
import numpy as np
import pytest

from postproc.pictures.plots import STYLE, figure_of_size
from postproc.report.svg import inline_svg


@pytest.fixture
def figure():
    with mpl.rc_context(STYLE):
        figure = figure_of_size(3.0, 2.0)
        axes = figure.subplots()
        axes.plot(np.linspace(0.0, 1.0, 50), np.linspace(0.0, 1.0, 50) ** 2)
        axes.plot([0.0, 0.5], [0.123456789, 1.0], ".", rasterized=True)
        axes.set_title("a < b & c > d")
    return figure


def test_it_is_self_contained(figure):
    svg = inline_svg(figure, "one", "t", "d")
    assert "xmlns" not in svg
    assert "<style" not in svg
    assert "<metadata" not in svg
    assert "://" not in svg
    assert set(re.findall(r'href="([^"]{6})', svg)) <= {"#one-m", "data:i"}


def test_two_pictures_share_no_identifier(figure):
    one, other = (inline_svg(figure, name, "t", "d") for name in ("one", "two"))
    first, second = (set(re.findall(r' id="([^"]+)"', svg)) for svg in (one, other))
    assert first
    assert not first & second
    assert {a or b for a, b in re.findall(r'url\(#([^)]+)\)|href="#([^"]+)"', one)} == first


def test_text_stays_text(figure):
    svg = inline_svg(figure, "one", "t", "d")
    assert "a &lt; b &amp; c &gt; d" in svg
    assert "var(--sans)" in svg
    assert "DejaVu" not in svg
    assert 'role="img"' in svg
    assert 'aria-labelledby="t"' in svg


def test_numbers_are_short_and_the_size_is_kept(figure):
    svg = inline_svg(figure, "one", "t", "d")
    for name in ("d", "x", "transform", "viewBox"):
        for value in re.findall(rf' {name}="([^"]*)"', svg):
            assert not re.search(r"\.\d\d\d", value), value
    assert 'viewBox="0 0 216 144"' in svg
