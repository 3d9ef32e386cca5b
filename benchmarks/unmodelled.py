"""Coverage where the world has what the model has not: a body, walls, two slopes, late fixes.

python benchmarks/unmodelled.py [--runs N] [--jobs N] [--only NAME] [--json FILE] [--markdown FILE]

Each effect is added to walks of the scoreboard past one transmitter, under white noise of 3 dB and
under noise of two scales (`worlds.TWO_SCALE`). No constant of the locator was chosen on them.
With `PYTHONPATH=TREE` before it the locator of another tree is measured on the same walks.
"""

import os
import sys
from collections.abc import Sequence

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # each process has one core

from scoreboard import unmodelled
from scoreboard.output import argument_parser, print_and_write


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print the table, write the files asked for."""
    parser = argument_parser(__doc__)
    parser.add_argument("--runs", type=int, default=unmodelled.RUNS, metavar="N", help="of a line")
    parser.add_argument("--only", choices=unmodelled.KINDS, metavar="NAME", help="one effect")
    asked = parser.parse_args(arguments)
    found = unmodelled.scores(list(unmodelled.jobs(asked.runs, asked.only)), asked.jobs)
    print_and_write(unmodelled.tables(found), found, asked)
    return 0


if __name__ == "__main__":
    sys.exit(main())
