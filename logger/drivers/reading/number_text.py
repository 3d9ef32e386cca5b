"""A number that remembers how it was printed.

The value of `a5f` is 2655 whether it was sent so or has lost a digit of `a53f`. What tells is the
width, beside the other numbers of the reply and of the modem; so the text travels with the value
until `recognition` has seen them all.
"""

from dataclasses import dataclass
from typing import Self


@dataclass(frozen=True, slots=True)
class Form:
    """Base of a number, and the widths in which all its digits are there."""

    base: int
    whole: frozenset[int]


class NumberText(int):
    """An integer, equal to any of the same value, with its text; `proven` where the reply has said
    it twice.
    """

    text: str
    form: Form
    proven: bool

    def __new__(cls, value: int, text: str, form: Form, proven: bool = False) -> Self:
        """Number of that value; the text without blanks, sign and 0x."""
        number = super().__new__(cls, value)
        number.text = text.strip().lower().removeprefix("0x")
        number.form = form
        number.proven = proven
        return number

    def __reduce__(self) -> tuple[type["NumberText"], tuple[int, str, Form, bool]]:
        """What makes a copy of it."""
        return NumberText, (int(self), self.text, self.form, self.proven)


def proven(number: int | None) -> int | None:
    """The number, needing no other proof of its digits."""
    return (
        NumberText(number, number.text, number.form, proven=True)
        if isinstance(number, NumberText)
        else number
    )
