"""Coverage below simulated antennas of several heights, passed at several distances.

python benchmarks/height.py [--runs N] [--jobs N] [--json FILE] [--markdown FILE]

With `PYTHONPATH=TREE` before it the locator of another tree is measured on the same walks.
"""

import os
import sys
from collections.abc import Sequence

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # each process has one core

from scoreboard import heights
from scoreboard.output import argument_parser, print_and_write


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print the tables, write the files asked for."""
    parser = argument_parser(__doc__)
    parser.add_argument("--runs", type=int, default=heights.RUNS, metavar="N", help="in each cell")
    asked = parser.parse_args(arguments)
    found = heights.scores(list(heights.jobs(asked.runs)), asked.jobs)
    print_and_write(heights.tables(found), found, asked)
    return 0


if __name__ == "__main__":
    sys.exit(main())
