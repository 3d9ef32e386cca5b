"""The answer about one cell: one type, live and at the desktop, in every output.

`answer_of` makes it of a posterior and its verdict. status.json, the JSON of `smooth` and `guide`,
exports, survey rows and pages are projections of it. Positions are degrees (WGS 84), lengths
metres, levels dBm at the scale of the first modem.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from msgspec import Struct

from logger.core.ellipse import Ellipse
from logger.core.locator.rivals import relevant_modes, whole_percents
from logger.core.types import Verdict

if TYPE_CHECKING:  # the status is written before numpy is imported
    from logger.core.locator.alternatives import Alternative
    from logger.core.locator.posterior import Posterior
    from logger.core.model.prior import Prior


DEGREE_DECIMALS = 6
"""0.1 m."""


class StrongestReading(Struct, frozen=True, kw_only=True):
    """Where the receiver was at the strongest reading."""

    lat: float
    lon: float
    level_dbm: float


class Mode(Struct, frozen=True, kw_only=True):
    """A local maximum; `percent` is null where its probability is too small to count."""

    lat: float
    lon: float
    probability: float
    percent: int | None
    ellipse95: Ellipse


class Position(Struct, frozen=True, kw_only=True):
    """A position to show, and the radii about it that hold 95 % and 50 % of the probability."""

    lat: float
    lon: float
    r95_m: float
    r50_m: float

    @property
    def position(self) -> "Position":
        """The position alone."""
        return Position(lat=self.lat, lon=self.lon, r95_m=self.r95_m, r50_m=self.r50_m)

    def to_tenth_metre(self) -> "Position":
        """The position alone, as it is shown while walking."""
        lat, lon = (round(angle, DEGREE_DECIMALS) for angle in (self.lat, self.lon))
        return Position(lat=lat, lon=lon, r95_m=round(self.r95_m, 1), r50_m=round(self.r50_m, 1))


class Place(Position, frozen=True, kw_only=True):
    """Where the transmitter may stand; the position shown is that of the first of the `modes`.

    The likeliest mode is first. `drms_m` is the root mean square distance from the position,
    `area_m2` that of the smallest region with 95 %, `strongest` the strongest reading.
    """

    drms_m: float
    area_m2: float
    modes: tuple[Mode, ...]
    strongest: StrongestReading

    @property
    def likely_modes(self) -> tuple[Mode, ...]:
        """The modes that count."""
        return tuple(mode for mode in self.modes if mode.percent is not None)


@dataclass(frozen=True, slots=True)
class Parameters:
    """P0 at 1 m, exponent and noise over the posterior, its prior, and what hypotheses say alone.

    `white_share` is the share of white noise in the variance `sigma_db` squared of the levels.
    """

    p0_dbm: float
    p0_sigma_db: float
    eta: float
    eta_sigma: float
    sigma_db: float
    decorrelation_m: float
    white_share: float
    prior: "Prior"
    alternatives: "tuple[Alternative, ...]"


@dataclass(frozen=True, slots=True)
class Provenance:
    """What the answer is made from: `n` readings with a position, of these `runs`.

    `first_ns` and `last_ns` are the times of the first and the last reading, ns since boot of their
    runs; None without one. `n_scans` identified the cell without doubt; None where nobody counted.
    """

    n: int
    first_ns: int | None = None
    last_ns: int | None = None
    n_scans: int | None = None
    runs: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Answer:
    """What is known about one cell.

    `reasons` say why the verdict is what it is, the decisive one first, then what else to know.
    `place` and `parameters` are None where the readings determine no posterior.
    """

    cell: str
    verdict: Verdict
    reasons: tuple[str, ...]
    provenance: Provenance
    place: Place | None = None
    parameters: Parameters | None = None


def answer_of(
    cell: str,
    verdict: Verdict,
    reasons: Iterable[str],
    provenance: Provenance,
    posterior: "Posterior | None",
) -> Answer:
    """The answer that the verdict on a posterior gives; or on none."""
    place = parameters = None
    if posterior is not None:
        place, parameters = place_of(posterior), parameters_of(posterior)
    return Answer(cell, verdict, tuple(reasons), provenance, place, parameters)


def place_of(posterior: "Posterior") -> Place:
    """A posterior in degrees."""
    relevant = relevant_modes(posterior.modes)
    percents = dict(zip(map(id, relevant), whole_percents(relevant), strict=True))
    strongest = posterior.strongest
    strongest_lat, strongest_lon = strongest.places.first_deg
    lat, lon = posterior.place.first_deg
    modes = []
    for mode in posterior.modes:
        mode_lat, mode_lon = mode.place.first_deg
        modes.append(
            Mode(
                lat=mode_lat,
                lon=mode_lon,
                probability=mode.probability,
                percent=percents.get(id(mode)),
                ellipse95=mode.ellipse,
            )
        )
    return Place(
        lat=lat,
        lon=lon,
        r50_m=posterior.r50_m,
        r95_m=posterior.r95_m,
        drms_m=posterior.drms_m,
        area_m2=posterior.region_area_m2,
        modes=tuple(modes),
        strongest=StrongestReading(
            lat=strongest_lat, lon=strongest_lon, level_dbm=strongest.level_dbm.item()
        ),
    )


def parameters_of(posterior: "Posterior") -> Parameters:
    """What a posterior says of the levels."""
    return Parameters(
        p0_dbm=posterior.p0_dbm,
        p0_sigma_db=posterior.p0_sigma_db,
        eta=posterior.eta,
        eta_sigma=posterior.eta_sigma,
        sigma_db=posterior.sigma_db,
        decorrelation_m=posterior.decorrelation_m,
        white_share=posterior.white_share,
        prior=posterior.prior,
        alternatives=posterior.alternatives,
    )
