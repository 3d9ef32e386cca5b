"""The rules that ask a database of cells, at the desk: once about all runs.

P3: the database does not have the cell. S10: the levels reject the position that it has.
"""

from collections.abc import Iterator, Sequence
from math import log
from typing import NamedTuple

from logger.core.runfile import Run
from logger.core.suspicion.rule import Evidence, Finding, Rate, Rule
from postproc.progress import Progress
from postproc.result import Options
from postproc.scan_counts import observed_cells
from postproc.verification.celldb import CellDb
from postproc.verification.claims import away_m, claims_of
from postproc.verification.parsing import identity_of

_FEWEST = 5
"""Other cells from which on their share in the database says something about this place."""
_MOST_NATS = 2.0
"""Less than any word needs: absence is never an alarm by itself."""
_P_FA = 0.01
"""Level of the test of a position: that at which its rate was measured."""


class _Desk:
    """Runs, the names of their cells, and which of these the database has."""

    def __init__(
        self, runs: Sequence[Run], names: Sequence[str], database: CellDb, progress: Progress | None
    ) -> None:
        self.runs, self.database, self.progress = runs, database, progress
        self.names = [name for name in names if identity_of(name) is not None]
        self.known = {name for name in self.names if database.by_identity(name)}


class _Cell(NamedTuple):
    """A cell; a run rejects its position in the database by so many metres, and so surely."""

    name: str
    apart_m: float = 0.0
    p: float = 1.0


def _missing_cells(desk: _Desk) -> Iterator[_Cell]:
    """Cells that the database does not have, where enough others were heard."""
    if len(desk.names) > _FEWEST:
        yield from (_Cell(name) for name in desk.names if name not in desk.known)


def _missing_nats(desk: _Desk, _cell: _Cell) -> float:
    """By the share of the cells here that the database has."""
    return min(-log(1.0 - (len(desk.known) + 1) / (len(desk.names) + 1)), _MOST_NATS)


@Rule[_Desk, _Cell](
    id="P3",
    family="plan",
    needs=("identity", "cell database"),
    gate="weighed by the share of cells here that the database has; never alone",
    sentence="the database does not have this cell, but {share:.0%} of the others heard here",
    harmless="databases are incomplete",
    about=_missing_cells,
    detection=1.0,
    elsewhere=Rate(100, 197, 0.0, "a database that had 41 to 58 % of 197 cells"),
    weigh=_missing_nats,
)
def _others_are_known(desk: _Desk, _cell: _Cell) -> Evidence | None:
    n_others = len(desk.names) - 1
    share = len(desk.known) / n_others
    return {"share": round(share, 2), "cells": n_others} if share >= 0.5 else None


def _rejected_positions(desk: _Desk) -> Iterator[_Cell]:
    """The tests are those of `postproc verify`: the spread of a database's position enters them."""
    # numba and scipy, which take a second, are for those who give a database
    from postproc.verification.run_claims import verify_claims  # noqa: PLC0415

    for run in desk.runs:
        claims = claims_of(desk.database, list(observed_cells([run], None)))
        verified = verify_claims(run, claims, _P_FA, Options().prior, progress=desk.progress)
        for verdict in verified.cells:
            if verdict.verdict != "rejected" or verdict.p is None or verdict.best_deg is None:
                continue
            claimed_deg = (verdict.claim.lat_deg, verdict.claim.lon_deg)
            yield _Cell(verdict.cell, away_m(claimed_deg, verdict.best_deg), verdict.p)


@Rule[_Desk, _Cell](
    id="S10",
    family="place",
    needs=("identity", "level", "position", "cell database"),
    gate="a test of the whole walk rejects the position at a level of 1 %",
    sentence="the levels reject its position in the database by {apart_m} m (p = {p})",
    harmless="a wrong or old position in the database, hills and tall buildings",
    about=_rejected_positions,
    detection=0.25,
    elsewhere=Rate(3, 161, 0.0, "161 measured walks past surveyed cells"),
)
def _elsewhere(_desk: _Desk, cell: _Cell) -> Evidence | None:
    return {"apart_m": round(cell.apart_m), "p": float(f"{cell.p:.2g}")}


DATABASE_RULES = (_others_are_known, _elsewhere)


def database_findings(
    runs: Sequence[Run], names: Sequence[str], database: CellDb, progress: Progress | None = None
) -> Iterator[Finding]:
    """Findings about the cells of runs, each without a time or a place of its own."""
    desk = _Desk(runs, names, database, progress)
    for rule in DATABASE_RULES:
        for cell in rule.about(desk):
            evidence = rule.check(desk, cell)
            if evidence is not None:
                nats = rule.nats("") if rule.weigh is None else rule.weigh(desk, cell)
                text = rule.sentence.format(**evidence)
                yield Finding(rule, cell.name, 0, None, None, text, evidence, nats)
