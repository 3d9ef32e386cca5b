"""Patterns of rows whose values stand in a fixed order, with labels or without."""

import re
from collections.abc import Iterable, Mapping

Form = Iterable[tuple[str, str]]
"""Labels of the values, each with the pattern of its value."""


def form(labels: str, patterns: Mapping[str, str]) -> list[tuple[str, str]]:
    """Form of words `label/kind`, a kind being a name of `patterns`; `_` in a label is a blank."""
    words = (word.split("/") for word in labels.split())
    return [(label.replace("_", " "), patterns[kind]) for label, kind in words]


def labelled_row(form: Form, between: str) -> re.Pattern[str]:
    """Pattern of `label: value` in the order of the form; a group is named as its label."""
    return _row(
        (rf"{re.escape(label)}\s?:\s*(?P<{_group(label)}>{value})" for label, value in form),
        between,
    )


def listed_row(form: Form) -> re.Pattern[str]:
    """Pattern of values between commas in the order of the form."""
    return _row((rf"(?P<{_group(label)}>{value})" for label, value in form), r"\s*,\s*")


def _row(parts: Iterable[str], between: str) -> re.Pattern[str]:
    return re.compile(
        r"(?<![\w.,-])" + between.join(parts) + r"(?![\w.])", re.IGNORECASE | re.ASCII
    )


def _group(label: str) -> str:
    return re.sub(r"\W", "_", label.lower())
