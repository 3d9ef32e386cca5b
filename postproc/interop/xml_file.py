"""XML: elements of a file one by one, and files that any reader takes."""

import re
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree as ET
from xml.parsers import expat

from logger.core.errors import RunFileError
from logger.core.foreign import open_regular
from postproc.foreign_file import LONGEST_ITEM, MOST_DEPTH

_CHUNK = 1 << 16

_NO_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""XML 1.0, 2.2: characters that a file may not hold, even escaped."""


def elements(source: Path, *names: str) -> Iterator[ET.Element]:
    """Elements of these names in the file's order, without namespaces; of nested ones the outer.

    Raises `RunFileError` for damaged XML, a document type, and elements within more than
    `MOST_DEPTH` others or longer than `LONGEST_ITEM`.
    """
    found = _Elements(frozenset(names))
    try:
        with open_regular(source) as file:
            while chunk := file.read(_CHUNK):
                yield from found.of(chunk)
            yield from found.of(b"", is_end=True)
    # Python has no decoder for an encoding, or none that expat can use
    except (OSError, expat.ExpatError, ValueError, LookupError) as error:
        raise RunFileError(f"{source} is damaged XML: {error}") from error


class _Elements:
    """Elements of some names as the file comes; of everything else nothing is kept."""

    def __init__(self, names: frozenset[str]) -> None:
        self._names = names
        self._whole: list[ET.Element] = []
        self._tree: ET.TreeBuilder | None = None
        self._depth = self._top = 0
        self._bytes = self._began = 0
        self._parser = expat.ParserCreate(namespace_separator="}")
        self._parser.buffer_text = True
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.CharacterDataHandler = self._text
        self._parser.StartDoctypeDeclHandler = _refuse

    def of(self, chunk: bytes, *, is_end: bool = False) -> list[ET.Element]:
        self._whole = []
        self._parser.Parse(chunk, is_end)
        self._bytes += len(chunk)
        # expat keeps what has no end yet: a tag, a comment
        began = self._parser.CurrentByteIndex if self._tree is None else self._began
        if self._bytes - began > LONGEST_ITEM:
            line = self._parser.CurrentLineNumber
            raise ValueError(f"line {line}: an element has more than {LONGEST_ITEM >> 20} MB")
        return self._whole

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        self._depth += 1
        if self._depth > MOST_DEPTH:
            raise ValueError(f"more than {MOST_DEPTH} elements within each other")
        name = tag.rpartition("}")[2]
        if self._tree is None and name in self._names:
            self._tree, self._top = ET.TreeBuilder(), self._depth
            self._began = self._parser.CurrentByteIndex
        if self._tree is not None:
            self._tree.start(name, attributes)

    def _text(self, text: str) -> None:
        if self._tree is not None:
            self._tree.data(text)

    def _end(self, tag: str) -> None:
        if self._tree is not None:
            self._tree.end(tag.rpartition("}")[2])
            if self._depth == self._top:
                self._whole.append(self._tree.close())
                self._tree = None
        self._depth -= 1


def _refuse(*_: object) -> None:
    raise ValueError("a document type, which no log has")


def add(parent: ET.Element, name: str, text: object = None, /, **attributes: str) -> ET.Element:
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
