"""The elements of an HTML page."""

from dataclasses import dataclass, field
from html.parser import HTMLParser

VOID = {
    "meta",
    "link",
    "br",
    "img",
    "hr",
    "input",
    "path",
    "use",
    "rect",
    "circle",
    "image",
    "clippath",
}


def with_spaces(html: str) -> str:
    """Without no-break spaces."""
    return html.replace("\N{NO-BREAK SPACE}", " ")


@dataclass
class Element:
    """One element: its name, attributes, ancestors' names and the text in it."""

    tag: str
    attributes: dict[str, str]
    within: tuple[str, ...]
    parts: list[str] = field(default_factory=list)

    @property
    def text(self) -> str:
        return " ".join("".join(self.parts).split())

    def get(self, name: str) -> str:
        return self.attributes.get(name, "")


class Page(HTMLParser):
    """Every element of a page in order; raises where the tags are not balanced."""

    def __init__(self, html: str) -> None:
        super().__init__(convert_charrefs=True)
        self.elements: list[Element] = []
        self._open: list[Element] = []
        self.feed(html)
        self.close()
        assert not self._open, [element.tag for element in self._open]

    def handle_starttag(self, tag, attrs):
        element = Element(tag, {k: v or "" for k, v in attrs}, tuple(e.tag for e in self._open))
        self.elements.append(element)
        if tag not in VOID - {"clippath"}:
            self._open.append(element)

    def handle_startendtag(self, tag, attrs):
        self.elements.append(
            Element(tag, {k: v or "" for k, v in attrs}, tuple(e.tag for e in self._open))
        )

    def handle_endtag(self, tag):
        if tag in VOID - {"clippath"}:
            return
        assert self._open, tag
        assert self._open[-1].tag == tag, (self._open[-1], tag)
        self._open.pop()

    def handle_data(self, data):
        for element in self._open:
            element.parts.append(data)

    def all(self, *tags: str) -> list[Element]:
        return [element for element in self.elements if element.tag in tags]

    def by_id(self, name: str) -> Element:
        (element,) = [e for e in self.elements if e.get("id") == name]
        return element

    @property
    def text(self) -> str:
        return next(element.text for element in self.elements if element.tag == "body")
