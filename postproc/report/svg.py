"""A picture as part of a page: in the page's colours, with identifiers of its own, referring to
nothing outside.
"""

import io
import re
from xml.etree import ElementTree as ET

import matplotlib as mpl
from markupsafe import Markup
from matplotlib.figure import Figure

from postproc.pictures import colours
from postproc.pictures.plots_style import PIXELS_PER_INCH, STYLE

_THEMED = {"ink": colours.INK, "muted": colours.MUTED, "grid": colours.GRID, "paper": colours.PAPER}
"""Colours of a picture that the page chooses, by the name of its custom property."""

_SVG = "{http://www.w3.org/2000/svg}"
_NUMBERS = ("d", "x", "y", "width", "height", "transform", "viewBox")
_LONG = re.compile(r"(\.\d\d)\d+")
_FONT = re.compile(r"(font(?:-family)?:(?: bold)?(?: [\d.]+px)?) '[^;]*")
_REFERENCE = re.compile(r"url\(#([^)]+)\)")
_VARIABLES = {f"#{r:02x}{g:02x}{b:02x}": f"var(--{name})" for name, (r, g, b) in _THEMED.items()}


def inline(figure: Figure, name: str, labelled_by: str, described_by: str) -> Markup:
    """SVG of a figure to be put into HTML, transparent; `name` must be its own on the page."""
    root = ET.fromstring(_drawn(figure))  # noqa: S314 (what matplotlib just wrote)
    for dropped in root.findall(f"{_SVG}metadata"):
        root.remove(dropped)
    for parent in root.iter(f"{_SVG}defs"):
        for style in parent.findall(f"{_SVG}style"):  # it would hold for the whole page
            parent.remove(style)
    used = _referred(root)
    for element in root.iter():
        element.tag = element.tag.removeprefix(_SVG)
        element.attrib = _own(element.attrib, name, used)
        element.tail = None
        if element.tag != "text" and element.text and not element.text.strip():
            element.text = None
    for size in ("width", "height", "version"):
        root.attrib.pop(size, None)
    root.attrib |= {
        "class": "picture",
        "role": "img",
        "aria-labelledby": labelled_by,
        "aria-describedby": described_by,
    }
    return Markup(ET.tostring(root, encoding="unicode"))  # noqa: S704 (every text in it went through the XML writer)


def _drawn(figure: Figure) -> bytes:
    written = io.BytesIO()
    with mpl.rc_context(STYLE | {"svg.fonttype": "none"}):
        figure.savefig(
            written, format="svg", dpi=PIXELS_PER_INCH, transparent=True, metadata={"Date": None}
        )
    return written.getvalue()


def _referred(root: ET.Element) -> set[str]:
    """Identifiers that something in the picture refers to."""
    found = set()
    for element in root.iter():
        found |= {
            value[1:]
            for key, value in element.attrib.items()
            if key.endswith("href") and value[:1] == "#"
        }
        found |= {match for value in element.attrib.values() for match in _REFERENCE.findall(value)}
    return found


def _own(attributes: dict[str, str], name: str, used: set[str]) -> dict[str, str]:
    """Attributes with short numbers, the page's colours, and identifiers that no other picture
    has.
    """
    found: dict[str, str] = {}
    for key, value in attributes.items():
        if key == "id":
            found |= {key: f"{name}-{value}"} if value in used else {}
        elif key.endswith("href"):
            found["href"] = f"#{name}-{value[1:]}" if value.startswith("#") else value
        elif key in _NUMBERS:
            found[key] = _LONG.sub(r"\1", value)
        else:
            found[key] = _themed(_REFERENCE.sub(rf"url(#{name}-\1)", value))
    return found


def _themed(value: str) -> str:
    value = _FONT.sub(r"\1 var(--sans)", value)
    for colour, variable in _VARIABLES.items():
        value = value.replace(colour, variable)
    return value
