"""How much the locator's answer changes where measured walks are disturbed a little.

python benchmarks/stability.py [--stride K] [--seeds N] [--walk NAME ...] [--jobs N] [--json FILE]
                               [--markdown FILE]

With `PYTHONPATH=TREE` before it the locator of another tree is measured.
"""

import os
import sys
from collections.abc import Sequence

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # each process has one core

from scoreboard import stability, traces
from scoreboard.output import argument_parser, print_and_write


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print the tables, write the files asked for."""
    parser = argument_parser(__doc__)
    parser.add_argument("--stride", type=int, default=1, metavar="K", help="every Kth walk")
    parser.add_argument("--seeds", type=int, default=stability.SEEDS, metavar="N", help="of a walk")
    parser.add_argument("--walk", nargs="+", metavar="NAME", help="only these")
    asked = parser.parse_args(arguments)
    chosen = [one for one in traces.traces() if asked.walk is None or one.name in asked.walk]
    if not chosen:
        print("the measured walks are not beside this repository", file=sys.stderr)
        return 1
    found = stability.disturb_walks(chosen[:: asked.stride], asked.jobs, asked.seeds)
    print_and_write(stability.tables(found), found, asked)
    return 0


if __name__ == "__main__":
    sys.exit(main())
