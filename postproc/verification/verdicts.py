"""Verdicts on claimed positions: what `verify` returns."""

from dataclasses import dataclass
from typing import Literal

from msgspec import UNSET, Struct, UnsetType

from postproc.verification.claims import Claim

Verdict = Literal["consistent", "rejected", "cannot tell"]
Followed = Literal["indirect"]


@dataclass(frozen=True, slots=True)
class Detectable:
    """Smallest displacement towards an azimuth that is rejected with 95 %.

    None where none up to `limit_m` is.

    `indirect_blind_m` is a larger one that is not, as the mirror image of a straight walk; None
    where there is none. `direct_m` and `direct_blind_m` are of a test that is no longer made.
    """

    azimuth_deg: float
    indirect_m: float | None
    indirect_blind_m: float | None
    limit_m: float
    direct_m: None = None
    direct_blind_m: None = None


@dataclass(frozen=True, slots=True)
class CellVerdict:
    """One claim about one cell; values are None where they cannot be computed, `reasons` say why.

    `p` is the p-value of the claim in the posterior, also named `p_indirect` (Verma et al.: the
    test that `followed` names), and `q` the same adjusted for the number of claims. `level` is that
    of the smallest highest-density region of the posterior that contains the claim, `distance_m`
    the claim's from the walk, `best_deg` the posterior's best position (latitude, longitude).
    `notices_m` is the least displacement that is rejected with 95 %, whatever its direction.
    `p_direct`, `p_direct_model`, `p_indirect_model` and `normality` are of tests that are no longer
    made. `error` is that of the program which ended the test, None where none did.
    """

    cell: str
    n: int
    claim: Claim
    verdict: Verdict
    reasons: tuple[str, ...]
    followed: Followed | None = None
    p: float | None = None
    q: float | None = None
    p_direct: None = None
    p_indirect: float | None = None
    p_direct_model: None = None
    p_indirect_model: None = None
    level: float | None = None
    distance_m: float | None = None
    best_deg: tuple[float, float] | None = None
    power: tuple[Detectable, ...] = ()
    notices_m: float | None = None
    normality: tuple[()] = ()
    error: str | None = None

    @property
    def detectable_m(self) -> list[float | None]:
        """Least displacement that the test rejects with probability 0.95, by direction."""
        return [direction.indirect_m for direction in self.power]


@dataclass(frozen=True, slots=True)
class Verified:
    """Verdicts on all claims of a run.

    `without_claim` are cells observed that no claim is about, which is no alarm; `heard_once` are
    cells identified in one scan only or never without doubt, which are not tested.
    """

    p_fa: float
    cells: tuple[CellVerdict, ...]
    without_claim: tuple[str, ...]
    warnings: tuple[str, ...]
    heard_once: tuple[str, ...] = ()


class SiteVerdict(Struct, kw_only=True):
    """Whether a cell has one transmitter or two, as `postproc verify --sites --json` prints it.

    `places` are latitude and longitude of the two likeliest positions; `log_factor` is the log
    Bayes factor of two against one, and `p` the share of `draws` walks simulated past one
    transmitter that have one as large. They are left out where `why_not` says why there is no test,
    and `error` where none of the program ended it.
    """

    cell: str
    verdict: Literal["two places", "no sign of two places"]
    why_not: str | None = None
    log_factor: float | UnsetType = UNSET
    p: float | UnsetType = UNSET
    draws: int | UnsetType = UNSET
    places: list[tuple[float, float]] | UnsetType = UNSET
    error: str | UnsetType = UNSET
