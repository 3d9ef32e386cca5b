"""Tables for the terminal and in Markdown."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite

from rich.console import Console
from rich.table import Table as RichTable

Lines = list[tuple[str, ...]]


@dataclass(frozen=True, slots=True)
class Table:
    """Headings and lines of text; the first column is aligned to the left."""

    title: str
    headings: tuple[str, ...]
    lines: Lines

    def show(self, console: Console) -> None:
        """Print it."""
        table = RichTable(title=self.title, title_justify="left", title_style="bold")
        for k, heading in enumerate(self.headings):
            table.add_column(heading, justify="left" if k == 0 else "right")
        for line in self.lines:
            table.add_row(*line)
        console.print(table)

    def markdown(self) -> str:
        """The same with the title as a heading."""
        rows = [self.headings, tuple("---" for _ in self.headings), *self.lines]
        return f"## {self.title}\n\n" + "\n".join("| " + " | ".join(row) + " |" for row in rows)


def three_digits(value: float | None) -> str:
    """A number with three digits, "-" for None."""
    if value is None:
        return "-"
    if not isfinite(value):
        return "inf"
    if abs(value) >= 1e6:
        return f"{value:.1e}"
    rounded = float(f"{value:.3g}")
    return f"{rounded:.{0 if abs(value) >= 100 else 2 - (abs(value) >= 10)}f}"


def limits(low: float, high: float) -> str:
    """What is wanted of a figure."""
    if not isfinite(high):
        return f">= {low:.2f}"
    return f"{low:.2f} to {high:.2f}" if isfinite(low) else f"<= {high:.2f}"


def show(parts: Sequence[Table | str], console: Console) -> None:
    """Print tables and text in their order."""
    for part in parts:
        if isinstance(part, Table):
            part.show(console)
        else:
            console.print(part, style="dim", highlight=False)


def in_markdown(parts: Sequence[Table | str]) -> str:
    """Tables and text in their order, in Markdown."""
    return "\n\n".join(part.markdown() if isinstance(part, Table) else part for part in parts)
