"""Coverage and errors of the locator on measured walks with a surveyed transmitter.

python benchmarks/measured.py [--jobs N] [--quick] [--json FILE] [--markdown FILE]

With `PYTHONPATH=TREE` before it the locator of another tree is measured, such as one made by
`git worktree add TREE fc7563c`.
"""

import os
import sys
from collections.abc import Sequence

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # each process has one core

from scoreboard import measured, measured_report, traces
from scoreboard.output import argument_parser, print_and_write

QUICK_STRIDE = 15
"""With `--quick` every fifteenth walk."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print the tables, write the files asked for."""
    parser = argument_parser(__doc__)
    parser.add_argument("--quick", action="store_true", help=f"every {QUICK_STRIDE}th walk")
    asked = parser.parse_args(arguments)
    chosen = traces.traces()[:: QUICK_STRIDE if asked.quick else 1]
    if not chosen:
        print("the measured walks are not beside this repository", file=sys.stderr)
        return 1
    scores = measured.score_walks(chosen, asked.jobs)
    parts = measured_report.tables(scores)
    print_and_write(parts, scores, asked)
    return 0


if __name__ == "__main__":
    sys.exit(main())
