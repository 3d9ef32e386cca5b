"""Options and files that the benchmarks of many walks share."""

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from .tables import Table, in_markdown, show

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

TABLE_WIDTH = 150
"""In columns, of what is not printed to a terminal."""


def argument_parser(description: str) -> argparse.ArgumentParser:
    """Number of processes, and the files to write."""
    parser = argparse.ArgumentParser(description=description.splitlines()[0])
    parser.add_argument("--jobs", type=int, default=2, metavar="N", help="processes")
    parser.add_argument("--json", type=Path, metavar="FILE")
    parser.add_argument("--markdown", type=Path, metavar="FILE")
    return parser


def print_and_write(
    parts: Sequence[Table | str], scores: "Sequence[DataclassInstance]", asked: argparse.Namespace
) -> None:
    """Print the tables; write these and the scores to the files asked for."""
    show(parts, Console(width=None if sys.stdout.isatty() else TABLE_WIDTH))
    if asked.json:
        asked.json.write_text(json.dumps([asdict(one) for one in scores], indent=1) + "\n")
    if asked.markdown:
        asked.markdown.write_text(in_markdown(parts) + "\n")
