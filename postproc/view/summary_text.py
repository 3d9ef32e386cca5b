"""The report panel: the answer for a cell as Markdown."""

from collections.abc import Sequence

import numpy as np

from logger.core.locator.alternatives import alternatives_text
from postproc.pictures.estimates import estimator_rows
from postproc.pictures.path_loss import ETA, P0
from postproc.pictures.picture import headline
from postproc.result import CellResult
from postproc.verification.verdicts import CellVerdict
from postproc.view.view_model import CellView, ViewModel

_COLOURS = (
    "Blue: posterior (thin outline 95 % region, thick outline 50 % region, glow density). "
    "Orange: EKF. Teal: RTS. Red: least squares. Grey: reference EKF. Violet: truth of a "
    "simulation. The track is coloured by level, from blue (weak) to red (strong). "
    "Move the time cursor below to see the answer develop."
)


def empty_report(view: ViewModel) -> str:
    """Report of a run in which no cell was observed."""
    return _join("# No cell", _runs(view), _list(view.survey.warnings))


def cell_report(view: ViewModel, cell: CellView) -> str:
    """Verdict, warnings, all estimators, and claims."""
    result = cell.result
    verdict = headline(result)
    warnings = [text for text in result.warnings if text not in verdict]
    return _join(
        f"# Cell {_escape(cell.name)}",
        f"**{verdict}**",
        f"{_runs(view)}; {result.n} readings of this cell",
        _list([*warnings, *_run_texts(view, result)]),
        _estimators(result),
        _error(view, cell),
        _claims(cell.claims),
        _list(view.survey.warnings),
        _prior(result),
        _COLOURS,
    )


def _join(*paragraphs: str) -> str:
    return "\n\n".join(filter(None, paragraphs))


def _runs(view: ViewModel) -> str:
    survey = view.survey
    runs = [
        f"{'SIMULATED run' if walk.run.meta.truth else 'Run'} `{walk.run.path.name}`, "
        f"{survey.clock.start_text(i) or 'unknown date'}"
        for i, walk in enumerate(survey.walks)
    ]
    cells = {levels.cell for walk in survey.walks for levels in walk.levels}
    return "; ".join([*runs, f"{len(cells)} cells observed"])


def _list(lines: Sequence[str]) -> str:
    return "\n".join(f"- {_escape(text)}" for text in lines)


def _run_texts(view: ViewModel, result: CellResult) -> list[str]:
    """What each of several runs contributed, and the answer without it."""
    texts = []
    for share in result.shares if len(result.shares) > 1 else ():
        text = f"{view.survey.walks[share.run].run.path.name} contributed {share.n} readings"
        if share.offset_db and share.sigma_db:
            text += f" (modem offset {share.offset_db:+.1f} ± {share.sigma_db:.1f} dB)"
        without = result.without.get(share.run)
        texts.append(f"{text}; without it: {headline(without)}" if without else text)
    return texts


def _estimators(cell: CellResult) -> str:
    rows = [
        [
            row.name,
            *(f"{value:.6f}" for value in row.position_deg),
            row.extent,
            P0.text(*row.p0) if row.p0 else "",
            ETA.text(*row.eta) if row.eta else "",
        ]
        for row in estimator_rows(cell)
    ]
    return _table(("", "latitude", "longitude", "50 %; 95 % (m)", "P0", "eta"), rows)


def _table(titles: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table in Markdown; nothing without rows."""
    if not rows:
        return ""
    return "\n".join(f"| {' | '.join(row)} |" for row in (titles, ["---"] * len(titles), *rows))


def _error(view: ViewModel, cell: CellView) -> str:
    posterior, truth_m = cell.result.posterior, cell.picture.truth_m
    if truth_m is None or posterior is None:
        return ""
    best_m = np.array([posterior.x_m, posterior.y_m]) - view.survey.origin_m
    error_m = float(np.hypot(*(best_m - truth_m)))
    return f"Simulated: the best position is {error_m:.0f} m from the truth."


def _claims(claims: Sequence[CellVerdict]) -> str:
    rows = [
        [
            f"{tested.claim.lat_deg:.6f} {tested.claim.lon_deg:.6f}",
            _escape(tested.claim.source),
            f"**{tested.verdict}**",
            _escape(tested.reasons[0] if tested.reasons else ""),
        ]
        for tested in claims
    ]
    return _table(("claimed position", "source", "verdict", "reason"), rows)


def _prior(result: CellResult) -> str:
    if result.posterior is None:
        return ""
    prior = result.posterior.prior
    return (
        f"Prior: P0 {prior.p0_dbm:.0f} ± {prior.p0_sigma_db:.0f} dBm, "
        f"eta {prior.eta:.1f} ± {prior.eta_sigma:.1f}, "
        f"level standard deviation about {prior.sigma_db:.0f} dB, "
        f"at most {prior.reach_m / 1000:.0f} km away; "
        f"{alternatives_text(result.posterior.alternatives)}."
    )


def _escape(text: str) -> str:
    """Text in which nothing is markup."""
    return "".join(f"\\{c}" if c in "\\`*_[]<>#|" else c for c in text)
