"""P3: cells that a database does not have, weighed by how complete it is here."""

from collections.abc import Iterator, Mapping, Sequence
from math import log

from logger.core.suspicion.finding import Finding
from logger.core.suspicion.rules import RULES
from postproc.verification.celldb import CellDb
from postproc.verification.parsing import identity_of

_FEWEST = 5
"""Other cells from which on their share in the database says something about this place."""
_MOST_NATS = 2.0
"""Less than any word needs: absence is never an alarm by itself."""


def missing_in_database(
    findings: Mapping[str, Sequence[Finding]], database: CellDb
) -> Iterator[Finding]:
    """Findings about cells that the database does not have; none if it has few of the others."""
    rule = RULES["P3"]
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
            yield Finding(
                rule.id, rule.family, name, 0, None, None,
                rule.sentence.format(**evidence), evidence, nats,
            )  # fmt: skip
