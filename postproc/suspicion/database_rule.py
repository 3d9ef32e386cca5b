"""P3: a database does not have the cell. S10: the levels reject the position it has there."""

from collections.abc import Iterator, Mapping, Sequence
from math import log

from logger.core.runfile import Run
from logger.core.suspicion.finding import Evidence, Finding, Rule
from logger.core.suspicion.rules import RULES
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


def missing_in_database(
    findings: Mapping[str, Sequence[Finding]], database: CellDb
) -> Iterator[Finding]:
    """Findings about cells that the database does not have; none if it has few of the others."""
    names = [name for name in findings if identity_of(name) is not None]
    known = {name for name in names if database.by_identity(name)}
    for name in names:
        n_others = len(names) - 1
        if name in known or n_others < _FEWEST:
            continue
        share = len(known) / n_others
        nats = min(-log(1.0 - (len(known) + 1) / (n_others + 2)), _MOST_NATS)
        evidence = {"share": round(share, 2), "cells": n_others}
        if share >= 0.5:
            yield _finding(RULES["P3"], name, evidence, nats)


def rejected_positions(
    run: Run, database: CellDb, progress: Progress | None = None
) -> Iterator[Finding]:
    """Findings about cells whose position in the database the levels of a run reject.

    The tests are those of `postproc verify`: the spread of a database's position enters them.
    """
    # scipy, which takes a second, is for those who give a database
    from postproc.verification.run_claims import verify_claims  # noqa: PLC0415

    rule = RULES["S10"]
    claims = claims_of(database, list(observed_cells([run], None)))
    verified = verify_claims(run, claims, _P_FA, Options().prior, progress=progress)
    for verdict in verified.cells:
        if verdict.verdict != "rejected" or verdict.p is None or verdict.best_deg is None:
            continue
        claimed_deg = (verdict.claim.lat_deg, verdict.claim.lon_deg)
        apart_m = away_m(claimed_deg, verdict.best_deg)
        evidence: Evidence = {"apart_m": round(apart_m), "p": float(f"{verdict.p:.2g}")}
        yield _finding(rule, verdict.cell, evidence, rule.nats(rule.elsewhere))


def _finding(rule: Rule, cell: str, evidence: Evidence, nats: float) -> Finding:
    """A finding about the whole run, without a time or a place of its own."""
    text = rule.sentence.format(**evidence)
    return Finding(rule.id, rule.family, cell, 0, None, None, text, evidence, nats)
