"""The answer in words, as markdown."""

from collections.abc import Sequence
from math import sqrt

import numpy as np

from logger.core.ellipse import ellipse95
from logger.core.geo import Utm
from logger.core.utc import utc_text
from postproc.pictures.picture import headline
from postproc.verification.run_claims import CellVerdict
from postproc.view.view_model import Story, Subject

_COLOURS = (
    "Blue is the posterior (thin: 95 %, thick: 50 % region, its glow the density), orange the EKF, teal RTS, red least "
    "squares, grey the reference EKF, violet the truth of a simulation. The way is blue where the cell was weak, red "
    "where it was strong. Move the time below to see how the answer came about."
)


def report_of_nothing(story: Story) -> str:
    """Of a run in which no cell was heard."""
    return "\n\n".join(part for part in ("# No cell", _runs(story), _list(story.warnings)) if part)


def report(story: Story, subject: Subject) -> str:
    """Verdict, warnings, the estimators side by side, and claims."""
    result = subject.result
    told = headline(result)
    parts = [
        f"# Cell {_plain(subject.cell)}",
        f"**{told}**",
        _runs(story) + f"; {result.n} readings of this cell",
        _list([text for text in result.warnings if text not in told]),
        _table(subject),
        _truth(story, subject),
        _claims(subject.claims),
        _list(story.warnings),
        _prior(subject),
        _COLOURS,
    ]
    return "\n\n".join(part for part in parts if part)


def _runs(story: Story) -> str:
    def of(i: int) -> str:
        run, timebase = story.walks[i].run, story.clock.timebases[i]
        simulated = "SIMULATED run" if run.meta.truth else "Run"
        when = utc_text(timebase.utc_ns(run.meta.started_ns)) if timebase else "unknown date"
        return f"{simulated} `{run.path.name}`, {when}"

    heard = {levels.cell for walk in story.walks for levels in walk.levels}
    return "; ".join(of(i) for i in range(len(story.walks))) + f"; {len(heard)} cells heard"


def _list(lines: Sequence[str]) -> str:
    return "\n".join(f"- {_plain(text)}" for text in lines)


def _table(subject: Subject) -> str:
    picture, posterior = subject.picture, subject.result.posterior
    if picture.track is None or (posterior is None and not picture.estimates):
        return ""
    rows = ["| | latitude | longitude | 95 % (m) | P0 (dBm) | eta |", "|---|---|---|---|---|---|"]
    if posterior is not None:
        place = _place(picture.track.utm, posterior.x_m, posterior.y_m)
        p0, eta = (posterior.p0_dbm, posterior.p0_sigma_db), (posterior.eta, posterior.eta_sigma)
        size = f"radius {posterior.r95_m:.0f}"
        rows.append(
            f"| posterior | {place} | {size} | {_with_sigma(p0, 1)} | {_with_sigma(eta, 2)} |"
        )
    for estimate in picture.estimates:
        east, north = picture.origin_m
        place = _place(picture.track.utm, east + float(estimate.x[0]), north + float(estimate.x[1]))
        axes = ellipse95(estimate.p[0, 0], estimate.p[0, 1], estimate.p[1, 1])
        sigmas = np.sqrt(np.maximum(np.diagonal(estimate.p), 0.0)).tolist()
        p0, eta = ((float(estimate.x[i]), sigmas[i]) for i in (2, 3))
        size = f"{axes.semi_major_m:.0f} x {axes.semi_minor_m:.0f}"
        rows.append(
            f"| {estimate.name} | {place} | {size} | {_with_sigma(p0, 1)} | {_with_sigma(eta, 2)} |"
        )
    return "\n".join(rows)


def _truth(story: Story, subject: Subject) -> str:
    posterior, truth_m = subject.result.posterior, subject.picture.truth_m
    if truth_m is None or posterior is None:
        return ""
    (east, north), (true_x, true_y) = story.origin_m, truth_m
    off_m = sqrt((posterior.x_m - east - true_x) ** 2 + (posterior.y_m - north - true_y) ** 2)
    return f"Simulated: the best place is {off_m:.0f} m from the truth."


def _claims(claims: Sequence[CellVerdict]) -> str:
    if not claims:
        return ""
    rows = ["| claim | from | verdict | why |", "|---|---|---|---|"]
    for one in claims:
        place = f"{one.claim.lat_deg:.6f} {one.claim.lon_deg:.6f}"
        why = one.reasons[0] if one.reasons else ""
        rows.append(f"| {place} | {_plain(one.claim.source)} | **{one.verdict}** | {_plain(why)} |")
    return "\n".join(rows)


def _prior(subject: Subject) -> str:
    if subject.result.posterior is None:
        return ""
    prior = subject.result.posterior.prior
    return (
        f"Believed before the walk: P0 {prior.p0_dbm:.0f} ± {prior.p0_sigma_db:.0f} dBm, "
        f"eta {prior.eta:.1f} ± {prior.eta_sigma:.1f}, scatter about {prior.sigma_db:.0f} dB, "
        f"no farther than {prior.reach_m / 1000:.0f} km."
    )


def _place(utm: Utm, x_m: float, y_m: float) -> str:
    lat, lon = utm.to_latlon(x_m, y_m)
    return f"{lat:.6f} | {lon:.6f}"


def _with_sigma(value: tuple[float, float], decimals: int) -> str:
    return f"{value[0]:.{decimals}f} ± {value[1]:.{decimals}f}"


def _plain(text: str) -> str:
    """Text in which nothing is markup."""
    return "".join(f"\\{c}" if c in "\\`*_[]<>#|" else c for c in text)
