"""Every name in backticks in the documentation exists."""

import re

import pytest

from tests.docs import known_names
from tests.docs.commands import PROGRAMS, fits, help_of
from tests.docs.known_names import TERMS, file_exists, source_names
from tests.docs.pages import PAGES, code_spans, name_of

NAMED = [page for page in PAGES if page.parent.name != "systemd"]
"""systemd/README.md names files, packages and settings of Raspberry Pi OS, not of the source."""


def exists(span: str, page) -> bool:
    """True when one of the kinds of names contains a code span."""
    return (
        span in TERMS
        or span in source_names()
        or span.rstrip("()") in source_names()
        or file_exists(span, page)
        or _is_command(span)
        or _is_option(span)
        or _is_configuration(span)
    )


def _is_command(span: str) -> bool:
    words = span.removeprefix("sudo ").split()
    match words:
        case ["make", target, *_]:
            return target in known_names.make_targets()
        case ["pip", "install", package, *_]:
            return package.strip("'.[]") in known_names.extras()
        case ["python", "-m", module]:
            return module in source_names()
        case [script, *_] if script.startswith(("benchmarks/", "./systemd/")):
            return file_exists(script.removeprefix("./"), PAGES[0])
        case [program, *_] if program.rpartition("/")[2] in PROGRAMS:
            return fits(" ".join(words))
    return False


def _is_option(span: str) -> bool:
    option = span.split(maxsplit=1)[0]
    if not re.fullmatch(r"--?[a-z][a-z-]*", option):
        return False
    return option in source_names() or any(option in help_of(name) for name in PROGRAMS)


def _is_configuration(span: str) -> bool:
    key = span.partition(" = ")[0].rpartition("] ")[2]
    return key in known_names.configuration_keys()


@pytest.mark.parametrize("page", NAMED, ids=name_of)
def test_every_name_in_backticks_exists(page):
    assert [span for span in code_spans(page) if not exists(span, page)] == []


def test_every_term_is_used():
    used = {span for page in NAMED for span in code_spans(page)}
    assert sorted(set(TERMS) - used) == []


def test_invented_names_are_found():
    for name in ("ModemDriver", "logger/nowhere.py", "postproc smooth --colour", "make tea"):
        assert not exists(name, PAGES[0]), name
