"""The report panel: the answer for a cell as Markdown."""

from collections.abc import Sequence

import numpy as np

from logger.core.document import (
    Column,
    Degrees,
    Table,
    Word,
    markdown_table,
    markdown_text,
)
from logger.core.locator.alternatives import alternatives_text
from postproc.pictures.picture import headline
from postproc.result import CellResult
from postproc.summary import REFERENCE_NOTE, estimator_table
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
    result, runs = cell.result, [walk.run for walk in view.survey.walks]
    verdict = headline(result)
    warnings = [text for text in result.warnings if text not in verdict]
    return _join(
        f"# Cell {markdown_text(cell.name)}",
        f"**{verdict}**",
        f"{_runs(view)}; {result.n} readings of this cell",
        _list([*warnings, *_run_texts(view, result)]),
        markdown_table(estimator_table(result.answer(runs))),
        markdown_text(REFERENCE_NOTE if result.reference else ""),
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
    return "\n".join(f"- {markdown_text(text)}" for text in lines)


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


def _error(view: ViewModel, cell: CellView) -> str:
    posterior, truth_m = cell.result.posterior, cell.picture.truth_m
    if truth_m is None or posterior is None:
        return ""
    best_m = np.array([posterior.x_m, posterior.y_m]) - view.survey.origin_m
    error_m = float(np.hypot(*(best_m - truth_m)))
    return f"Simulated: the best position is {error_m:.0f} m from the truth."


def _claims(claims: Sequence[CellVerdict]) -> str:
    columns = (Column("claimed position"), Column("source"), Column("verdict"), Column("reason"))
    rows = [
        (
            Degrees(tested.claim.lat_deg, tested.claim.lon_deg),
            tested.claim.source,
            Word(tested.verdict),
            tested.reasons[0] if tested.reasons else "",
        )
        for tested in claims
    ]
    return markdown_table(Table(columns, rows))


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
