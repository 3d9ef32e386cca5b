"""Coverage and errors of the locator on measured walks with a surveyed transmitter.

python benchmarks/measured.py [--jobs N] [--quick] [--json FILE] [--markdown FILE]

With `PYTHONPATH=TREE` before it the locator of another tree is measured, such as one made by
`git worktree add TREE fc7563c`.
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
from scoreboard import measured, measured_report, traces
from scoreboard.tables import in_markdown, show

QUICK_STRIDE = 15
"""With `--quick` every fifteenth walk."""
TABLE_WIDTH = 150


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print the tables, write the files asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--jobs", type=int, default=2, metavar="N", help="processes")
    parser.add_argument("--quick", action="store_true", help=f"every {QUICK_STRIDE}th walk")
    parser.add_argument("--json", type=Path, metavar="FILE")
    parser.add_argument("--markdown", type=Path, metavar="FILE")
    asked = parser.parse_args(arguments)
    chosen = traces.traces()[:: QUICK_STRIDE if asked.quick else 1]
    if not chosen:
        print("the measured walks are not beside this repository", file=sys.stderr)
        return 1
    scores = measured.score_walks(chosen, asked.jobs)
    parts = measured_report.tables(scores)
    show(parts, Console(width=None if sys.stdout.isatty() else TABLE_WIDTH))
    if asked.json:
        asked.json.write_text(json.dumps([asdict(one) for one in scores], indent=1) + "\n")
    if asked.markdown:
        asked.markdown.write_text(in_markdown(parts) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
