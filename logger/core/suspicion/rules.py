"""The rules that each scan asks, and the version that changes with any of them.

A family's rules are asked in the order of its file. A rule that asks a database of cells at the
desk is in `postproc.suspicion.run_assessment`.
"""

import ast
from dataclasses import fields
from functools import lru_cache
from hashlib import sha256
from importlib.resources import files
from typing import Any

from logger.core.suspicion import (
    area,
    broadcast,
    earlier_walks,
    neighbours,
    place,
    plan,
    signal,
    technology,
    timing,
)
from logger.core.suspicion.heard import Memory
from logger.core.suspicion.rule import Rule
from logger.core.types import Note

_FAMILIES = (
    plan, area, neighbours, signal, place, timing, broadcast, technology, earlier_walks,
)  # fmt: skip

RULES: dict[str, Rule[Memory, Any]] = {
    rule.id: rule
    for family in _FAMILIES
    for rule in vars(family).values()
    if isinstance(rule, Rule)
}

RULES_CODE = "rules"
"""Code of the event that says which rules are applied."""


def rules_note() -> Note:
    """The event before the first finding: which rules are applied."""
    return Note("info", RULES_CODE, f"version {rules_version()}: {' '.join(RULES)}")


def rules_version() -> str:
    """Digest of the rules: of what each declares, and of the code and the tables of this package.

    The code is that of the syntax trees without positions, comments and docstrings, so neither
    these nor the version of Python change it. What a rule calls outside this package is not in it:
    if that changes, replay says that findings differ, which is true.
    """
    digest = sha256(_package_digest())
    for rule in RULES.values():
        for field in fields(rule):
            digest.update(f"{field.name} {_text_of(getattr(rule, field.name))}\n".encode())
    return digest.hexdigest()[:12]


def _text_of(value: Any) -> str:
    """A function by its name: its code is in the package."""
    if callable(value):
        return f"{value.__module__}.{value.__qualname__}"
    return repr(sorted(value) if isinstance(value, frozenset) else value)


@lru_cache(maxsize=1)
def _package_digest() -> bytes:
    package = files(__package__)
    digest = sha256((package / "data" / "countries.json.gz").read_bytes())
    for file in sorted(package.iterdir(), key=lambda file: file.name):
        if file.name.endswith(".py"):
            digest.update(shape_of_code(ast.parse(file.read_text("utf-8"))).encode())
    return digest.digest()


def shape_of_code(node: object) -> str:
    """A syntax tree as text, without empty fields: versions of Python add such."""
    if isinstance(node, list):
        return "[" + " ".join(shape_of_code(one) for one in node if not _is_text(one)) + "]"
    if not isinstance(node, ast.AST):
        return repr(node)
    named = [(name, value) for name, value in ast.iter_fields(node) if value not in (None, [])]
    inside = " ".join(f"{name}={shape_of_code(value)}" for name, value in named)
    return f"({type(node).__name__} {inside})"


def _is_text(node: object) -> bool:
    """A docstring or another text that nothing uses."""
    if not isinstance(node, ast.Expr) or not isinstance(node.value, ast.Constant):
        return False
    return isinstance(node.value.value, str)
