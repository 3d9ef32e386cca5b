"""A picture as part of a page: in the page's colours, with its own identifiers, self-contained."""

import base64
import io
import re
from xml.etree import ElementTree as ET

import matplotlib as mpl
from markupsafe import Markup
from matplotlib.figure import Figure
from PIL import Image

from postproc.pictures import colours
from postproc.pictures.plots import PIXELS_PER_INCH, STYLE

_PAGE_COLOURS = {
    "ink": colours.INK,
    "muted": colours.MUTED,
    "grid": colours.GRID,
    "paper": colours.PAPER,
    "bad": colours.RED,
    "doubt": colours.AMBER,
}
"""Colours of a picture that the page chooses, by the name of its custom property."""

PLACE = "place-"
"""What the name of a cell's mark begins with: the page keeps it."""
_SVG = "{http://www.w3.org/2000/svg}"
_NUMERIC = ("d", "x", "y", "width", "height", "transform", "viewBox")
_DECIMALS = re.compile(r"(\.\d\d)\d+")
_FONT = re.compile(r"(font(?:-family)?:(?: bold)?(?: [\d.]+px)?) '[^;]*")
_REFERENCE = re.compile(r"url\(#([^)]+)\)")
_PNG = "data:image/png;base64,"
_LARGE = 60_000
"""Letters; the dots of a plan are fewer and partly transparent."""
_QUALITY = 80
_VARIABLES = {
    f"#{red:02x}{green:02x}{blue:02x}": f"var(--{name})"
    for name, (red, green, blue) in _PAGE_COLOURS.items()
}


def inline_svg(figure: Figure, name: str, labelled_by: str, described_by: str) -> Markup:
    """SVG of a figure for HTML, transparent; `name` must be unique on the page."""
    root = ET.fromstring(_svg(figure))  # noqa: S314 (what matplotlib just wrote)
    for metadata in root.findall(f"{_SVG}metadata"):
        root.remove(metadata)
    for definitions in root.iter(f"{_SVG}defs"):
        for style in definitions.findall(f"{_SVG}style"):  # it would apply to all of the page
            definitions.remove(style)
    referenced = _referenced_ids(root)
    for element in root.iter():
        element.tag = element.tag.removeprefix(_SVG)
        element.attrib = _page_attributes(element.attrib, name, referenced)
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
    return Markup(ET.tostring(root, encoding="unicode"))  # noqa: S704 (the XML writer escapes text)


def _svg(figure: Figure) -> bytes:
    file = io.BytesIO()
    with mpl.rc_context(STYLE | {"svg.fonttype": "none"}):
        if layout := figure.get_layout_engine():  # savefig would draw all once more to lay it out
            layout.execute(figure)
            figure.set_layout_engine(None)
        figure.savefig(
            file, format="svg", dpi=PIXELS_PER_INCH, transparent=True, metadata={"Date": None}
        )
    return file.getvalue()


def _lean_picture(reference: str) -> str:
    """A large opaque picture as JPEG, which takes a fifth of the bytes of PNG."""
    if not reference.startswith(_PNG) or len(reference) < _LARGE:
        return reference
    picture = Image.open(io.BytesIO(base64.b64decode(reference.removeprefix(_PNG))))
    if picture.mode == "RGBA" and picture.getchannel("A").getextrema() != (255, 255):
        return reference
    file = io.BytesIO()
    picture.convert("RGB").save(file, "JPEG", quality=_QUALITY, optimize=True)
    return f"data:image/jpeg;base64,{base64.b64encode(file.getvalue()).decode()}"


def _referenced_ids(root: ET.Element) -> set[str]:
    ids = set()
    for element in root.iter():
        for key, value in element.attrib.items():
            ids |= set(_REFERENCE.findall(value))
            if key.endswith("href") and value.startswith("#"):
                ids.add(value[1:])
    return ids


def _page_attributes(attributes: dict[str, str], name: str, referenced: set[str]) -> dict[str, str]:
    changed: dict[str, str] = {}
    for key, value in attributes.items():
        if key == "id":
            is_named = value in referenced or value.startswith(PLACE)
            changed |= {key: f"{name}-{value}"} if is_named else {}
        elif key.endswith("href"):
            is_local = value.startswith("#")
            changed["href"] = f"#{name}-{value[1:]}" if is_local else _lean_picture(value)
        elif key in _NUMERIC:
            changed[key] = _DECIMALS.sub(r"\1", value)
        else:
            changed[key] = _in_page_colours(_REFERENCE.sub(rf"url(#{name}-\1)", value))
    return changed


def _in_page_colours(value: str) -> str:
    value = _FONT.sub(r"\1 var(--sans)", value)
    for colour, variable in _VARIABLES.items():
        value = value.replace(colour, variable)
    return value
