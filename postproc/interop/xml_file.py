"""XML: elements of a file one by one, and files that any reader takes."""

import re
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree as ET

from logger.core.errors import RunFileError

_NO_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""XML 1.0, 2.2: characters that a file may not hold, even escaped."""


def elements(source: Path, *names: str) -> Iterator[ET.Element]:
    """Elements of these names in the file's order, without namespaces; each is freed afterwards.

    Raises `RunFileError` for damaged XML.
    """
    try:
        for _, element in ET.iterparse(source, events=("end",)):  # noqa: S314 (`contents` refuses entities)
            element.tag = element.tag.rpartition("}")[2]
            if element.tag in names:
                yield element
                element.clear()
    except (OSError, ET.ParseError, UnicodeDecodeError) as error:
        raise RunFileError(f"{source} is damaged XML: {error}") from error


def add(parent: ET.Element, name: str, text: object = None, **attributes: str) -> ET.Element:
    """A child with a text; nothing forbidden is left in it."""
    child = ET.SubElement(parent, name, attributes)
    if text is not None:
        child.text = _NO_XML.sub("", str(text))
    return child


def write(root: ET.Element, target: Path) -> None:
    ET.indent(root, " ")
    ET.ElementTree(root).write(target, encoding="utf-8", xml_declaration=True)


def decimal(value: float, decimals: int) -> str:
    """A number as xsd:decimal: never with an exponent."""
    return f"{value:.{decimals}f}"
