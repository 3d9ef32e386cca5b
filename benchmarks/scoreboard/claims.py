"""The specification's own scenario: what its table claims, and what can be reached.

The bound is local. It does not know of far places that fit as well, and around a circle there are
many: the inverse point of its middle is infinitely far away. So it may say that a claim is too
good, never that it can be met.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from .cases import SPECIFIED_READINGS
from .run import Scores
from .score import BOUND
from .summary import rows_of

CLAIMED_M = dict(zip(SPECIFIED_READINGS, (200.0, 100.0, 50.0), strict=True))
READINGS_OF = {"begun": "the first of 50 around the circle", "around": "all around the circle"}


@dataclass(frozen=True, slots=True)
class Claim:
    """Error claimed after some readings, and the median errors measured, by method.

    `bound_m` is the median error of a Gaussian that reaches the Cramer-Rao bound with priors on P0
    and eta.
    """

    readings: int
    where: str
    claimed_m: float
    bound_m: float
    median_error_m: Mapping[str, float]

    @property
    def is_within_bound(self) -> bool:
        """Whether the claim is not beyond the bound."""
        return self.claimed_m >= self.bound_m


def claims(found: Mapping[str, Scores]) -> list[Claim]:
    """Claims beside what was measured, for those cases that were run."""
    results = []
    for name, where in READINGS_OF.items():
        for count, claimed_m in CLAIMED_M.items():
            scores = found.get(f"spec-{count}-{name}", {})
            if BOUND not in scores:
                continue
            errors = {row.method: row.median_error_m for row in rows_of(scores)}
            results.append(Claim(count, where, claimed_m, errors.pop(BOUND), errors))
    return results
