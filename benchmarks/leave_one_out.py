"""Constants of the locator's prior, chosen without each campaign of measured walks in turn.

python benchmarks/leave_one_out.py [--constant NAME ...] [--jobs N] [--stride K] [--json FILE]
                                   [--markdown FILE]
"""

import argparse
import json
import os
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # each process has one core

from rich.console import Console
from scoreboard import leave_one_out, measured, traces
from scoreboard.tables import in_markdown, show
from scoreboard.tree import Prior

TABLE_WIDTH = 150


def main(arguments: Sequence[str] | None = None) -> int:
    """Locate all walks with every value, print the tables, write the files asked for."""
    prior = Prior()
    constants = leave_one_out.constants(prior)
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--constant",
        nargs="+",
        choices=list(constants),
        default=list(constants),
        metavar="NAME",
        help=f"of {', '.join(constants)}",
    )
    parser.add_argument("--jobs", type=int, default=2, metavar="N", help="processes")
    parser.add_argument("--stride", type=int, default=1, metavar="K", help="every K-th walk only")
    parser.add_argument("--json", type=Path, metavar="FILE")
    parser.add_argument("--markdown", type=Path, metavar="FILE")
    asked = parser.parse_args(arguments)
    chosen = traces.traces()[:: asked.stride]
    if not chosen:
        print("the measured walks are not beside this repository", file=sys.stderr)
        return 1
    # a value that is the present one need not be computed once more
    priors = {"": prior}
    for name in asked.constant:
        priors |= {
            f"{name} {value}": variant
            for value, variant in constants[name].items()
            if variant != prior
        }
    scores = measured.score_walks(chosen, asked.jobs, priors, decide=False)
    by_variant = {v: [one for one in scores if one.variant == v] for v in priors}
    parts = []
    for name in asked.constant:
        by_value = {
            value: by_variant["" if variant == prior else f"{name} {value}"]
            for value, variant in constants[name].items()
        }
        parts += leave_one_out.tables(name, by_value, by_variant[""])
    show(parts, Console(width=None if sys.stdout.isatty() else TABLE_WIDTH))
    if asked.json:
        asked.json.write_text(json.dumps([asdict(one) for one in scores], indent=1) + "\n")
    if asked.markdown:
        asked.markdown.write_text(in_markdown(parts) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
