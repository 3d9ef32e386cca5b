"""Where one cell stands, from its readings in all runs of a survey.

The steps are those of `postproc smooth`. Beyond it, many modems are put on one scale (`alignment`),
very many readings are thinned (`thin`), and two transmitters are tried with several modems too.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import msgspec
import numpy as np
import shapely
from shapely.geometry import shape

from logger.core.answer import Position, place_of
from logger.core.arrays import BoolArray
from logger.core.locator.pipeline import locate, unless_it_moves
from logger.core.locator.posterior import Posterior
from logger.core.locator.preparation import MOST_MODEMS, of_most_heard_modems
from logger.core.locator.two_source_test import Division, divide, divide_in_time
from logger.core.locator.verdict import assess
from logger.core.model.blocks import squares
from logger.core.readings import Readings
from logger.core.suspicion.rule import Word
from logger.core.types import Verdict
from postproc.cell_work import Failure, attempt
from postproc.estimators.region_outline import geojson
from postproc.ground import elsewhere_reasons, middle_of, place_name, places_of
from postproc.multi_run import in_order, merge
from postproc.result import Options
from postproc.scan_counts import too_rarely
from postproc.smoothing import too_few
from postproc.survey.alignment import Alignment, align
from postproc.survey.walk_readings import SurveyRun

MOST_READINGS = 200_000
OF_A_SQUARE = 256
_MOST_SQUARES = 1000
"""As many as the locator pools readings into."""


class ModemOffset(msgspec.Struct, frozen=True):
    """How much higher a modem reads this cell than the first; None where that is unknown."""

    modem: str
    offset_db: float | None
    sigma_db: float | None


class LocatedCell(msgspec.Struct, frozen=True, kw_only=True):
    """A cell of a survey: its verdict, with reasons, and its position where there is one.

    Positions are degrees (WGS 84) and metres in UTM zone `zone`. `two_sources` and `moved` are log
    Bayes factors of two transmitters, at once or one after the other, against one; None where it
    was not tried. An identity heard farther apart than any cell reaches has a row for each of
    `n_places` places; `place` 1 has most readings, `heard_near` is the place in words. `runs` are
    the digests of those that heard it there. `region_wkb` is the 95 % region in degrees. `word` is
    the worst word of suspicion by any of these runs, by the rules `word_rules` in `word_runs` runs,
    with the `word_reasons` of one; None where no run could be asked. `error` is the error of the
    program that ended the estimate, if any.
    """

    cell: str
    rat: str
    area: str
    verdict: Verdict
    reasons: tuple[str, ...]
    n_readings: int
    n_scans: int
    n_runs: int
    n_modems: int
    first_utc_ns: int | None
    last_utc_ns: int | None
    place: int = 1
    n_places: int = 1
    heard_near: str = ""
    runs: tuple[str, ...] = ()
    n_used: int = 0
    lat_deg: float | None = None
    lon_deg: float | None = None
    zone: int | None = None
    x_m: float | None = None
    y_m: float | None = None
    r50_m: float | None = None
    r95_m: float | None = None
    supposition: str | None = None
    region_m2: float | None = None
    probability: float | None = None
    p0_dbm: float | None = None
    p0_sigma_db: float | None = None
    eta: float | None = None
    eta_sigma: float | None = None
    sigma_db: float | None = None
    two_sources: float | None = None
    moved: float | None = None
    word: Word | None = None
    word_rules: tuple[str, ...] = ()
    word_reasons: tuple[str, ...] = ()
    word_runs: int = 0
    offsets: tuple[ModemOffset, ...] = ()
    region_wkb: bytes = b""
    error: str | None = None

    @property
    def where(self) -> str:
        """As `Position.where`, empty without one."""
        lat, lon, r95_m, r50_m = self.lat_deg, self.lon_deg, self.r95_m, self.r50_m
        if lat is None or lon is None or r95_m is None or r50_m is None:
            return ""
        return Position(lat=lat, lon=lon, r95_m=r95_m, r50_m=r50_m).where


_TOO_MANY_MODEMS = (
    f"of more than {MOST_MODEMS} modems of unknown offset those count that received most"
)


class CellRuns(NamedTuple):
    """Readings of a cell, and scans that named it, by digest of the run, in order of the runs."""

    cell: str
    area: str
    rat: str
    n_scans: Mapping[str, int]
    parts: Mapping[str, Readings]


def locate_cell_of(
    heard: CellRuns, runs: Mapping[str, SurveyRun], options: Options
) -> list[LocatedCell]:
    """The estimate over all runs, for each place in which the identity is heard."""
    places = places_of(heard.parts) or [{}]
    rows = [_row_of_place(_heard_in(near, heard), runs, options) for near in places]
    n_readings = sum(row.n_readings for row in rows)
    if len(rows) == 1:
        return rows
    return [
        msgspec.structs.replace(
            row,
            place=number,
            n_places=len(rows),
            heard_near=place_name(middle_of([obs.places for obs in near.values()])),
            reasons=(
                *row.reasons,
                *elsewhere_reasons(heard.cell, len(rows), n_readings - row.n_readings),
            ),
        )
        for number, (row, near) in enumerate(zip(rows, places, strict=True), 1)
    ]


def _heard_in(near: Mapping[str, Readings], heard: CellRuns) -> CellRuns:
    """What was heard of a cell in one place.

    Of a run that heard it in another place as well, scans count whose readings are here.
    """
    if not near:
        return heard
    n_scans = {
        digest: heard.n_scans.get(digest, 0)
        if len(part) == len(heard.parts[digest])
        else len(np.unique(part.scan_seq))
        for digest, part in near.items()
    }
    return heard._replace(parts=near, n_scans=n_scans)


def _row_of_place(heard: CellRuns, runs: Mapping[str, SurveyRun], options: Options) -> LocatedCell:
    located = attempt(heard.cell, "its estimate", lambda: _locate_place(heard, runs, options))
    if not isinstance(located, Failure):
        return located
    base = _without_position(heard, runs)
    return msgspec.structs.replace(base, reasons=(located.reason,), error=located.error)


def _locate_place(heard: CellRuns, runs: Mapping[str, SurveyRun], options: Options) -> LocatedCell:
    base = _without_position(heard, runs)
    why = too_rarely(sum(heard.n_scans.values()))
    if why or not heard.parts:
        return msgspec.structs.replace(base, reasons=(why or "no reading has a position",))
    parts = in_time_order(heard.parts, runs)
    own = [runs[digest] for digest in parts]
    obs = joined_readings(parts, [run.modem for run in own])
    if why := too_few(obs, obs.usable()):
        return msgspec.structs.replace(base, reasons=(why,))
    aligned = align(obs.usable())
    of_all_modems = thin(aligned.obs)
    posterior = locate(of_all_modems, options.prior)
    usable = of_most_heard_modems(of_all_modems)
    reasons = [_TOO_MANY_MODEMS] if len(usable) < len(of_all_modems) else []
    at_once, in_time = _divisions(usable, posterior)
    decision = assess(posterior, usable, _likelier(at_once, in_time), within_m=options.within_m)
    decision = unless_it_moves(decision, posterior, usable)
    place = place_of(posterior)
    region = shape(msgspec.to_builtins(geojson(posterior.squares, usable.utm)))
    return msgspec.structs.replace(
        base,
        verdict=decision.verdict,
        reasons=(*decision.reasons, *reasons),
        n_used=len(usable),
        lat_deg=place.lat,
        lon_deg=place.lon,
        zone=usable.utm.zone,
        x_m=posterior.x_m,
        y_m=posterior.y_m,
        r50_m=place.r50_m,
        r95_m=place.r95_m,
        supposition=place.supposition or None,
        region_m2=place.area_m2,
        probability=place.modes[0].probability,
        p0_dbm=posterior.p0_dbm,
        p0_sigma_db=posterior.p0_sigma_db,
        eta=posterior.eta,
        eta_sigma=posterior.eta_sigma,
        sigma_db=posterior.sigma_db,
        two_sources=at_once and at_once.log_factor,
        moved=in_time and in_time.log_factor,
        offsets=_offsets(own, obs.usable(), aligned, posterior),
        region_wkb=shapely.to_wkb(region),
    )


def in_time_order(
    parts: Mapping[str, Readings], runs: Mapping[str, SurveyRun]
) -> dict[str, Readings]:
    """As `multi_run.in_order`."""
    when = {digest: (runs[digest].modem, runs[digest].began_utc_ns) for digest in parts}
    return in_order(parts, when)


def joined_readings(parts: Mapping[str, Readings], modems: Sequence[str]) -> Readings:
    """All readings of a cell, which are in one zone, with the modem of each of `parts` numbered."""
    numbers = {modem: i for i, modem in enumerate(dict.fromkeys(modems))}
    return merge(dict(enumerate(parts.values())), [numbers[modem] for modem in modems])


def _without_position(heard: CellRuns, runs: Mapping[str, SurveyRun]) -> LocatedCell:
    own = [runs[digest] for digest in heard.parts]
    times = [run.began_utc_ns for run in own if run.began_utc_ns is not None]
    return LocatedCell(
        cell=heard.cell,
        rat=heard.rat,
        area=heard.area,
        verdict="cannot tell",
        reasons=(),
        n_readings=sum(map(len, heard.parts.values())),
        n_scans=sum(heard.n_scans.values()),
        n_runs=len(own),
        runs=tuple(run.digest for run in own),
        n_modems=len({run.modem for run in own}),
        first_utc_ns=min(times, default=None),
        last_utc_ns=max(times, default=None),
    )


def _divisions(usable: Readings, posterior: Posterior) -> tuple[Division | None, Division | None]:
    """Two transmitters at once, and one after the other; with the modems on one scale."""
    one_scale = usable
    if posterior.offsets is not None:
        one_scale = replace(usable.on_one_scale(posterior.offsets.mean_db), modem=None)
    return divide(one_scale, posterior), divide_in_time(one_scale, posterior)


def _likelier(one: Division | None, other: Division | None) -> Division | None:
    known = [division for division in (one, other) if division is not None]
    return max(known, key=lambda division: division.log_factor, default=None)


def _offsets(
    own: Sequence[SurveyRun], usable: Readings, aligned: Alignment, posterior: Posterior
) -> tuple[ModemOffset, ...]:
    """What each modem reads higher than the first: by shared ground, or by the locator of few.

    Unknown for one of many modems that shares too little ground with the first.
    """
    modems = list(dict.fromkeys(run.modem for run in own))
    if len(modems) < 2 or usable.modem is None:
        return ()
    located = posterior.offsets
    found = []
    for number, modem in enumerate(modems):
        rows = np.flatnonzero(usable.modem == number)
        if not len(rows) or np.isnan(aligned.sigma_db[number]):
            found.append(ModemOffset(modem, None, None))
            continue
        group = 0 if aligned.obs.modem is None else int(aligned.obs.modem[rows[0]])
        db, sigma_db = float(aligned.offset_db[number]), float(aligned.sigma_db[number])
        if located is not None:
            db += float(located.mean_db[group])
            sigma_db = float(np.hypot(sigma_db, located.sigma_db[group]))
        found.append(ModemOffset(modem, db, sigma_db))
    return tuple(found)


def thin(obs: Readings) -> Readings:
    """The readings that matter, in their order; they are usable ones.

    The locator takes the mean of a modem's readings in each of at most 1000 squares for one
    reading. 256 readings, evenly spread over those of a square, change its mean by a sixteenth of
    their standard deviation, some 0.3 dB where shadowing has 5 dB.
    """
    return obs if len(obs) <= MOST_READINGS else obs.part(_choice(obs))


def _choice(obs: Readings) -> BoolArray:
    """Which readings (n,) to keep: of each square, modem and censoring evenly spread ones."""
    square, _ = squares(obs.places, _MOST_SQUARES, obs.modem_numbers)
    key = square * 3 + obs.limit + 1
    order = np.argsort(key, kind="stable")
    first = np.searchsorted(key[order], key[order])
    count = np.bincount(key)[key[order]]
    rank = np.arange(len(key)) - first
    share = np.minimum(OF_A_SQUARE / count, 1.0)
    chosen = np.zeros(len(key), np.bool_)
    chosen[order] = np.floor((rank + 1) * share) > np.floor(rank * share)
    return chosen
