"""Errors and coverage of the locator, of other methods and of the exact limit.

python benchmarks/accuracy.py [--case NAME ...] [--method NAME ...] [--runs M] [--seed S] [--jobs N]
                              [--quick] [--json FILE] [--markdown FILE]
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from scoreboard.cases import CASES
from scoreboard.report import as_json, board, markdown, show
from scoreboard.run import collect_scores, jobs_of
from scoreboard.score import METHODS

QUICK_RUNS = 2
TABLE_WIDTH = 150


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the cases asked for, print the scoreboard, write the files asked for."""
    asked = _parser().parse_args(arguments)
    runs = QUICK_RUNS if asked.quick else asked.runs
    jobs = jobs_of(asked.case or CASES, asked.seed, runs, asked.method)
    columns = (
        TextColumn("runs"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(
        *columns, console=Console(stderr=True), disable=not sys.stderr.isatty()
    ) as progress:
        task = progress.add_task("runs", total=len(jobs))
        scores = collect_scores(jobs, asked.jobs, lambda: progress.advance(task))
    found = board(scores, asked.seed)
    show(found, Console(width=None if sys.stdout.isatty() else TABLE_WIDTH))
    for case in CASES.values():
        if case.most == 0 and (not asked.case or case.name in asked.case):
            print(f"{case.name} was left out: the measured walks are not beside this repository")
    if asked.json:
        asked.json.write_text(as_json(found) + "\n")
    if asked.markdown:
        asked.markdown.write_text(markdown(found))
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--case", nargs="+", choices=list(CASES), metavar="NAME", help=f"one of {', '.join(CASES)}"
    )
    parser.add_argument(
        "--method", nargs="+", choices=METHODS, metavar="NAME", help=f"one of {', '.join(METHODS)}"
    )
    parser.add_argument(
        "--runs",
        type=int,
        metavar="M",
        help="of each case (white noise 200, others 100, measured all)",
    )
    parser.add_argument("--seed", type=int, default=1, metavar="S")
    parser.add_argument("--jobs", type=int, default=2, metavar="N", help="processes")
    parser.add_argument("--quick", action="store_true", help=f"{QUICK_RUNS} runs of each case")
    parser.add_argument("--json", type=Path, metavar="FILE")
    parser.add_argument("--markdown", type=Path, metavar="FILE")
    return parser


if __name__ == "__main__":
    sys.exit(main())
