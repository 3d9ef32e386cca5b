"""Errors and coverage of the locator, of other methods and of the exact limit.

python benchmarks/accuracy.py [--case NAME ...] [--method NAME ...] [--runs M] [--seed S] [--jobs N]
                              [--quick] [--json FILE] [--markdown FILE]
"""

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # each process has one core

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from scoreboard import traces
from scoreboard.cases import CASES
from scoreboard.measured import score_walks
from scoreboard.report import as_json, board, markdown, show
from scoreboard.run import collect_scores, jobs_of
from scoreboard.score import METHODS, OURS

QUICK_RUNS = 2
QUICK_STRIDE = 50
"""With `--quick` every fiftieth measured walk."""
MEASURED = "measured"
"""Name of the measured walks among the cases."""
TABLE_WIDTH = 150


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the cases asked for, print the scoreboard, write the files asked for."""
    asked = _parser().parse_args(arguments)
    names = asked.case or [MEASURED, *CASES]
    runs = QUICK_RUNS if asked.quick else asked.runs
    jobs = jobs_of([name for name in names if name in CASES], asked.seed, runs, asked.method)
    walks = _walks(asked) if MEASURED in names else ()
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
        task = progress.add_task("runs", total=len(walks) + len(jobs))
        measured = score_walks(walks, asked.jobs, on_done=lambda: progress.advance(task))
        scores = collect_scores(jobs, asked.jobs, lambda: progress.advance(task))
    found = board(scores, measured, asked.seed)
    show(found, Console(width=None if sys.stdout.isatty() else TABLE_WIDTH))
    if MEASURED in names and not traces.traces():
        print("the measured walks were left out: they are not beside this repository")
    if asked.json:
        asked.json.write_text(as_json(found) + "\n")
    if asked.markdown:
        asked.markdown.write_text(markdown(found))
    return 0


def _walks(asked: argparse.Namespace) -> tuple[traces.Trace, ...]:
    """The measured walks to be located."""
    if asked.method and OURS not in asked.method:
        return ()
    return traces.traces()[:: QUICK_STRIDE if asked.quick else 1]


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--case",
        nargs="+",
        choices=[MEASURED, *CASES],
        metavar="NAME",
        help=f"one of {', '.join([MEASURED, *CASES])}",
    )
    parser.add_argument(
        "--method", nargs="+", choices=METHODS, metavar="NAME", help=f"one of {', '.join(METHODS)}"
    )
    parser.add_argument(
        "--runs",
        type=int,
        metavar="M",
        help="of each simulated case (60 to 200)",
    )
    parser.add_argument("--seed", type=int, default=1, metavar="S")
    parser.add_argument("--jobs", type=int, default=2, metavar="N", help="processes")
    parser.add_argument(
        "--quick", action="store_true", help=f"{QUICK_RUNS} runs of each case, some measured walks"
    )
    parser.add_argument("--json", type=Path, metavar="FILE")
    parser.add_argument("--markdown", type=Path, metavar="FILE")
    return parser


if __name__ == "__main__":
    sys.exit(main())
