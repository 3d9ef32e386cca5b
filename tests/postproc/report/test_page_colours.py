"""Colours of the page and of its pictures."""

import re


def test_pictures_use_the_colours_of_the_page(report):
    svgs = "".join(re.findall(r"<svg.*?</svg>", report.html, re.DOTALL))
    assert "var(--ink)" in svgs
    assert "var(--grid)" in svgs
    assert re.findall(r"#(?:000000|ffffff|1f242b|5c6470|dde1e6)", svgs) == []


def palettes(css):
    """Custom properties of the light, the dark and the printed page."""
    blocks = re.findall(r":root \{(.*?)\}", css, re.DOTALL)
    return [dict(re.findall(r"--([\w-]+): (#[0-9a-f]{3,6})\b", block)) for block in blocks]


def contrast(one, other):
    """WCAG 2.2, contrast ratio of two colours."""

    def luminance(colour):
        digits = colour[1:] if len(colour) == 7 else "".join(2 * c for c in colour[1:])
        parts = [int(digits[i : i + 2], 16) / 255 for i in (0, 2, 4)]
        linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts]
        return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]

    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


def test_text_has_enough_contrast_light_dark_and_printed(page):
    schemes = palettes(page.all("style")[0].text)
    assert len(schemes) == 3
    for colours in schemes:
        assert colours.keys() == schemes[0].keys()
        for ink in ("ink", "muted", "link"):
            assert (
                min(contrast(colours[ink], colours[ground]) for ground in ("paper", "ground"))
                >= 4.5
            ), ink
        for badge in ("good", "doubt", "none", "bad"):
            assert contrast(colours[badge], colours[f"{badge}-bg"]) >= 4.5, badge
