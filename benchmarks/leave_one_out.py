"""Constants of the locator's prior, chosen without each campaign of measured walks in turn.

python benchmarks/leave_one_out.py [--constant NAME ...] [--jobs N] [--stride K] [--json FILE]
                                   [--markdown FILE]
"""

import os
import sys
from collections.abc import Sequence

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # each process has one core

from scoreboard import leave_one_out, measured, traces
from scoreboard.output import argument_parser, print_and_write
from scoreboard.tree import Prior

from logger.core.locator import mixture

GROUP_POWER = "group_power"


def _by_group_power(
    chosen: Sequence[traces.Trace], processes: int, usual: list[measured.WalkScore]
) -> dict[str, list[measured.WalkScore]]:
    """Scores by the text of each value; worker processes inherit the constant."""
    found, present = {}, mixture.GROUP_POWER
    for power in leave_one_out.GROUP_POWERS:
        text = f"{power:g}"
        if power == present:
            found[text] = usual
            continue
        mixture.GROUP_POWER = power
        variants = {f"{GROUP_POWER} {text}": Prior()}
        found[text] = measured.score_walks(chosen, processes, variants, decide=False)
    mixture.GROUP_POWER = present
    return found


def main(arguments: Sequence[str] | None = None) -> int:
    """Locate all walks with every value, print the tables, write the files asked for."""
    prior = Prior()
    constants = leave_one_out.constants(prior)
    names = [*constants, GROUP_POWER]
    parser = argument_parser(__doc__)
    parser.add_argument(
        "--constant",
        nargs="+",
        choices=names,
        default=names,
        metavar="NAME",
        help=f"of {', '.join(names)}",
    )
    parser.add_argument("--stride", type=int, default=1, metavar="K", help="every K-th walk only")
    asked = parser.parse_args(arguments)
    chosen = traces.traces()[:: asked.stride]
    if not chosen:
        print("the measured walks are not beside this repository", file=sys.stderr)
        return 1
    # a value that is the present one need not be computed once more
    priors = {"": prior}
    of_prior = [name for name in asked.constant if name != GROUP_POWER]
    for name in of_prior:
        priors |= {
            f"{name} {value}": variant
            for value, variant in constants[name].items()
            if variant != prior
        }
    scores = measured.score_walks(chosen, asked.jobs, priors, decide=False)
    by_variant = {v: [one for one in scores if one.variant == v] for v in priors}
    parts = []
    for name in of_prior:
        by_value = {
            value: by_variant["" if variant == prior else f"{name} {value}"]
            for value, variant in constants[name].items()
        }
        parts += leave_one_out.tables(name, by_value, by_variant[""])
    if GROUP_POWER in asked.constant:
        by_power = _by_group_power(chosen, asked.jobs, by_variant[""])
        parts += leave_one_out.tables(GROUP_POWER, by_power, by_variant[""])
        scores += [one for some in by_power.values() for one in some if one.variant]
    print_and_write(parts, scores, asked)
    return 0


if __name__ == "__main__":
    sys.exit(main())
