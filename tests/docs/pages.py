"""The documentation: its pages, the code in their text and their links."""

import re
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FILES = ("README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "systemd/README.md")
PAGES = tuple(
    sorted(
        [
            *(ROOT / name for name in FILES),
            *(
                page
                for page in (ROOT / "docs").rglob("*.md")
                if page.parent.name != "generated"  # by a build of the site
            ),
        ]
    )
)
_BLOCK = re.compile(r"^( *)```(\S*)[^\n]*\n(.*?)^\1```$", re.MULTILINE | re.DOTALL)
_SPAN = re.compile(r"(?<!`)`([^`]+)`(?!`)")
_LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")
_FENCE = re.compile(r"^ *```")
_HEADING = re.compile(r"^(#+) (.*)$")
_COMMENT = re.compile(r"\s+# .*$")


@cache
def text_of(page: Path) -> str:
    """Text without code blocks."""
    return _BLOCK.sub("", page.read_text("utf-8"))


def code_spans(page: Path) -> list[str]:
    """Contents of all backticks outside code blocks, each once."""
    return list(dict.fromkeys(" ".join(s.split()) for s in _SPAN.findall(text_of(page))))


def links(page: Path) -> list[str]:
    """Targets of all links and images."""
    return _LINK.findall(text_of(page))


def shell_lines(page: Path) -> list[str]:
    """Lines of all shell blocks without their comments."""
    blocks = [body for _, language, body in _BLOCK.findall(page.read_text("utf-8"))
              if language == "sh"]  # fmt: skip
    lines = [_COMMENT.sub("", line).strip() for body in blocks for line in body.splitlines()]
    return [line for line in lines if line]


def name_of(page: Path) -> str:
    """The path of a page in the repository."""
    return page.relative_to(ROOT).as_posix()


def section_of(page: str, heading: str) -> str | None:
    """The section below a heading with its subsections, all of the page for the empty heading.

    None where the page has no such section.
    """
    if not heading:
        return page
    lines: list[str] = []
    depth, in_block = 0, False
    for line in page.splitlines():
        in_block ^= bool(_FENCE.match(line))
        match = None if in_block else _HEADING.match(line)
        if depth and match and len(match[1]) <= depth:
            break
        if depth:
            lines.append(line)
        elif match and match[2] == heading:
            depth = len(match[1])
    return "\n".join(lines) if depth else None
