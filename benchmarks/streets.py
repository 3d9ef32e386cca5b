"""Coverage and *located* of simulated transmitters at street level, among blocks of houses.

python benchmarks/streets.py [--runs N] [--jobs N] [--json FILE] [--markdown FILE]

With `PYTHONPATH=TREE` before it the locator of another tree is measured on the same walks.
"""

import os
import sys
from collections.abc import Sequence

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # each process has one core

from scoreboard import streets
from scoreboard.output import argument_parser, print_and_write


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print the table, write the files asked for."""
    parser = argument_parser(__doc__)
    parser.add_argument("--runs", type=int, default=streets.RUNS, metavar="N", help="of each kind")
    asked = parser.parse_args(arguments)
    found = streets.scores(list(streets.jobs(asked.runs)), asked.jobs)
    print_and_write(streets.tables(found), found, asked)
    return 0


if __name__ == "__main__":
    sys.exit(main())
