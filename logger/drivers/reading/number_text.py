"""A number that remembers how it was printed.

The value of `a5f` is 2655 whether the modem sent that or a digit of `a53f` was lost. The width
shows it, beside the other numbers of the reply and of the modem; so the text travels with the value
until `recognition` has compared them all.
"""

from dataclasses import dataclass
from typing import Self


@dataclass(frozen=True, slots=True)
class NumberForm:
    """Base of a number, and the widths in which no digit can be missing."""

    base: int
    full_widths: frozenset[int]

    def is_full(self, text: str) -> bool:
        """True for a number with all its digits."""
        return len(text) in self.full_widths


class NumberText(int):
    """An integer with its text, equal to any integer of the same value.

    `confirmed` where the reply contains the number twice.
    """

    text: str
    form: NumberForm
    confirmed: bool

    def __new__(cls, value: int, text: str, form: NumberForm, confirmed: bool = False) -> Self:
        """Number of that value; its text has no blanks, sign and 0x."""
        number = super().__new__(cls, value)
        number.text = text.strip().lower().removeprefix("0x")
        number.form = form
        number.confirmed = confirmed
        return number

    def __reduce__(self) -> tuple[type["NumberText"], tuple[int, str, NumberForm, bool]]:
        """What makes a copy of it."""
        return NumberText, (int(self), self.text, self.form, self.confirmed)


def confirm(number: int | None) -> int | None:
    """The number, marked as printed twice."""
    if not isinstance(number, NumberText):
        return number
    return NumberText(number, number.text, number.form, confirmed=True)
