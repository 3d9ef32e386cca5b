"""Coverage and errors of the locator on measured walks with a surveyed transmitter.

python benchmarks/measured.py [--campaign NAME ...] [--quick] [--against FILE] [--read FILE]
                              [--within-walk M] [--first N] [--jobs N] [--json FILE]
                              [--markdown FILE]

With `PYTHONPATH=TREE` before it the locator of another tree is measured, such as one made by
`git worktree add TREE fc7563c`. Its `--json` file is what `--against` compares with.
"""

import os
import sys
from collections.abc import Sequence
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # each process has one core

from scoreboard import measured, measured_report, traces
from scoreboard.output import argument_parser, print_and_write

QUICK_STRIDE = 15
"""With `--quick` every fifteenth walk."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print the tables, write the files asked for."""
    parser = argument_parser(__doc__)
    parser.add_argument("--quick", action="store_true", help=f"every {QUICK_STRIDE}th walk")
    campaigns = list(dict.fromkeys(one.campaign for one in traces.traces()))
    parser.add_argument(
        "--campaign", nargs="+", choices=campaigns, default=campaigns, metavar="NAME"
    )
    parser.add_argument("--first", type=int, metavar="N", help="the first walks of the list")
    parser.add_argument(
        "--within-walk", type=float, metavar="M", help="also within metres of the walk's hull"
    )
    parser.add_argument("--against", type=Path, metavar="FILE", help="scores of another tree")
    parser.add_argument("--read", type=Path, metavar="FILE", help="scores of an earlier run")
    asked = parser.parse_args(arguments)
    walks = traces.traces()[: asked.first]
    chosen = [one for one in walks if one.campaign in asked.campaign]
    if not chosen:
        print("the measured walks are not beside this repository", file=sys.stderr)
        return 1
    if asked.read:
        scores = [one for one in measured.read_scores(asked.read) if one.trace in chosen]
    else:
        stride = QUICK_STRIDE if asked.quick else 1
        variants = dict(measured.VARIANTS)
        if asked.within_walk is not None:
            variants["within"] = measured.prior_within(asked.within_walk)
        scores = measured.score_walks(chosen[::stride], asked.jobs, variants)
    within = [one for one in scores if one.beyond_m is not None]
    everywhere = [one for one in scores if one.beyond_m is None]
    parts = measured_report.tables(everywhere)
    if within:
        parts += measured_report.area_tables(everywhere, within)
    if asked.against:
        others = measured.read_scores(asked.against)
        parts += measured_report.comparison(everywhere, others, asked.against.name)
    print_and_write(parts, scores, asked)
    return 0


if __name__ == "__main__":
    sys.exit(main())
