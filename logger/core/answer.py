"""The answer about one cell: one type, live and at the desktop, in every output.

`answer_of` makes it of a posterior and its verdict. status.json, the JSON of `smooth` and `guide`,
exports, survey rows and pages are projections of it. Positions are degrees (WGS 84), lengths
metres, levels dBm at the scale of the first modem.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, Self

from msgspec import Struct
from msgspec.structs import replace

from logger.core.certainty import Ellipse, OnMap, radii_text, relevant_percents, share_text
from logger.core.types import Verdict

if TYPE_CHECKING:  # the status is written before numpy is imported
    from logger.core.locator.alternatives import Alternative
    from logger.core.locator.posterior import Posterior
    from logger.core.model.prior import Prior
    from logger.core.suspicion import rule

CONSPICUOUS = ("suspicious", "unusual")
"""Words of which an output speaks first, the worse first."""

Ring = list[tuple[float, float]]
"""Longitude and latitude of each corner; the first is repeated at the end (RFC 7946)."""


class MultiPolygon(Struct, kw_only=True):
    """GeoJSON geometry."""

    type: Literal["MultiPolygon"]
    coordinates: list[list[Ring]]


class Region(Struct, kw_only=True):
    """Smallest region with a share of the probability; empty without known squares."""

    area_m2: float | None = None
    geojson: MultiPolygon | None = None


class StrongestReading(OnMap, frozen=True, kw_only=True):
    """Where the receiver was at the strongest reading."""

    level_dbm: float


class Mode(OnMap, frozen=True, kw_only=True):
    """A local maximum; `percent` is null where its probability is too small to count."""

    probability: float
    percent: int | None
    ellipse95: Ellipse

    @property
    def where(self) -> str:
        """Latitude and longitude as far as known, if it is this one."""
        return self.within(self.ellipse95.semi_major_m)

    @property
    def share(self) -> str:
        """Its probability in words."""
        return share_text(self.probability if self.percent is None else self.percent / 100.0)

    def in_short(self) -> Self:
        """With a probability of three digits."""
        return replace(super().in_short(), probability=round(self.probability, 3))


class Position(OnMap, frozen=True, kw_only=True):
    """A position to show, and the radii about it that hold 95 % and 50 % of the probability."""

    r95_m: float
    r50_m: float

    @property
    def position(self) -> "Position":
        """The position alone."""
        return Position(lat=self.lat, lon=self.lon, r95_m=self.r95_m, r50_m=self.r50_m)

    @property
    def where(self) -> str:
        """Latitude and longitude as far as known."""
        return self.within(self.r95_m, self.r50_m)

    def in_short(self) -> Self:
        """With radii to 0.1 m."""
        radii = {"r95_m": round(self.r95_m, 1), "r50_m": round(self.r50_m, 1)}
        return replace(super().in_short(), **radii)


class Place(Position, frozen=True, kw_only=True, omit_defaults=True):
    """Where the transmitter may stand; the position shown is that of the first of the `modes`.

    The likeliest mode is first. `drms_m` is the root mean square distance from the position,
    `area_m2` that of the smallest region with 95 %, `strongest` the strongest reading. All is true
    only if the transmitter is in the `area`, where there is one; without it `outside_share` of the
    probability is elsewhere. Radii of one that `may_be_distant` suppose that it is not.
    """

    drms_m: float
    area_m2: float
    modes: tuple[Mode, ...]
    strongest: StrongestReading
    area: str = ""
    outside_share: float | None = None
    may_be_distant: bool = False

    @property
    def supposition(self) -> str:
        """What the radii suppose, if anything."""
        return supposition_of(self.area, may_be_distant=self.may_be_distant)

    def radii(self, about: str = "") -> str:
        """Both radii `about` a position, and what they suppose."""
        of = f" of {about}" if about else ""
        return ", ".join(
            filter(None, [f"{radii_text(self.r50_m, self.r95_m)}{of}", self.supposition])
        )

    @property
    def likely_modes(self) -> tuple[Mode, ...]:
        """The modes that count."""
        return tuple(mode for mode in self.modes if mode.percent is not None)

    def in_short(self) -> Self:
        """With the modes that count."""
        return replace(
            super().in_short(),
            drms_m=round(self.drms_m, 1),
            area_m2=round(self.area_m2),
            modes=tuple(mode.in_short() for mode in self.likely_modes),
            strongest=self.strongest.in_short(),
        )


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

    `first_utc_ns` and `last_utc_ns` are the times of the first and the last reading, with or
    without a position; None where no run knows UTC. `n_scans` identified the cell without doubt;
    None where nobody counted. `error` is that of the program which ended some of the work; None
    where none did.
    """

    n: int
    first_utc_ns: int | None = None
    last_utc_ns: int | None = None
    n_scans: int | None = None
    runs: tuple[str, ...] = ()
    error: str | None = None


@dataclass(frozen=True, slots=True)
class Word:
    """What the rules of suspicion say of a cell: word, score, and findings in the order of time."""

    word: "rule.Word"
    score_nats: float
    findings: "tuple[rule.Finding, ...]"
    cell: str

    @property
    def is_conspicuous(self) -> bool:
        """Unusual or suspicious."""
        return self.word in CONSPICUOUS


class PathEnd(OnMap, frozen=True, kw_only=True):
    """The last state of an estimator after `n` readings; without bounds its ellipse says nothing.

    P0 is in dBm at 1 m, `drms_m` the root mean square distance from the position.
    """

    drms_m: float
    p0_dbm: float
    p0_sigma_db: float
    eta: float
    eta_sigma: float
    ellipse95: Ellipse
    n: int
    is_bounded: bool = True


@dataclass(frozen=True, slots=True)
class Paths:
    """What filter, smoother and least squares state: where each ends, by its key.

    `failed` has the keys of those that did not converge.
    """

    ends: Mapping[str, PathEnd]
    failed: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Answer:
    """What is known about one cell.

    `reasons` say why the verdict is what it is, the decisive one first, then what else to know.
    `place` and `parameters` are None where the readings determine no posterior, `word` where
    suspicion was not asked, `paths` where only the posterior was computed, as live.
    """

    cell: str
    verdict: Verdict
    reasons: tuple[str, ...]
    provenance: Provenance
    place: Place | None = None
    parameters: Parameters | None = None
    word: Word | None = None
    paths: Paths | None = None

    @property
    def is_conspicuous(self) -> bool:
        """Of the word."""
        return self.word is not None and self.word.is_conspicuous

    @property
    def sentence(self) -> str:
        """The word and `verdict_sentence`."""
        word = f"{self.word.word}; " if self.word is not None and self.is_conspicuous else ""
        return f"{word}{self.verdict_sentence}"

    @property
    def verdict_sentence(self) -> str:
        """The verdict, why, and where."""
        where = ""
        if self.place is not None:
            where = f"{self.place.where}, {self.place.radii()}"
        if self.verdict == "located":
            return f"located at {where}"
        why = f": {self.reasons[0]}" if self.reasons else ""
        return f"{self.verdict}{why}{'; likeliest at ' if where else ''}{where}"

    @property
    def to_do(self) -> str:
        """As `to_do_about`."""
        word = "" if self.word is None else self.word.word
        return to_do_about(self.verdict, word)

    @property
    def latitude_deg(self) -> float | None:
        """Of the place; None without one."""
        return None if self.place is None else self.place.lat

    @property
    def longitude_deg(self) -> float | None:
        """Of the place; None without one."""
        return None if self.place is None else self.place.lon

    @property
    def error(self) -> str | None:
        """As `Provenance.error`."""
        return self.provenance.error


def to_do_about(verdict: str, word: str) -> str:
    """What to do about a cell with this word; empty unless it is conspicuous and located."""
    if verdict != "located" or word not in CONSPICUOUS:
        return ""
    again = "Walk by on another day: two walks that agree are a finding."
    return f"Go there and look, from afar. {again}"


def answer_of(
    cell: str,
    verdict: Verdict,
    reasons: Iterable[str],
    provenance: Provenance,
    posterior: "Posterior | None",
    word: Word | None = None,
    paths: Paths | None = None,
) -> Answer:
    """The answer of the verdict on a posterior; or on none."""
    place = parameters = None
    if posterior is not None:
        place, parameters = place_of(posterior), parameters_of(posterior)
    return Answer(cell, verdict, tuple(reasons), provenance, place, parameters, word, paths)


def supposition_of(area: str, *, may_be_distant: bool) -> str:
    """As `Place.supposition`."""
    if area:
        return f"if it is {area}"
    return "if it is no distant mast" if may_be_distant else ""


def place_of(posterior: "Posterior") -> Place:
    """A posterior in degrees."""
    strongest = posterior.strongest
    heard_at, best = strongest.places.on_map, posterior.place.on_map
    modes = []
    for mode, percent in zip(posterior.modes, relevant_percents(posterior.modes), strict=True):
        at = mode.place.on_map
        modes.append(
            Mode(
                lat=at.lat,
                lon=at.lon,
                probability=mode.probability,
                percent=percent,
                ellipse95=mode.ellipse,
            )
        )
    return Place(
        lat=best.lat,
        lon=best.lon,
        r50_m=posterior.r50_m,
        r95_m=posterior.r95_m,
        drms_m=posterior.drms_m,
        area_m2=posterior.region_area_m2,
        modes=tuple(modes),
        strongest=StrongestReading(
            lat=heard_at.lat, lon=heard_at.lon, level_dbm=strongest.level_dbm.item()
        ),
        area="" if posterior.prior.area is None else posterior.prior.area.text,
        outside_share=posterior.outside_share,
        may_be_distant=posterior.may_be_distant,
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


class NextWay(Struct, frozen=True):
    """Where to walk next: `azimuth_deg` from true north, to `lat, lon` (WGS 84).

    `text` says all of it and the reason, `why` the reason alone.
    """

    azimuth_deg: float
    distance_m: float
    lat: float
    lon: float
    nats_per_km: float
    text: str
    why: str = ""
