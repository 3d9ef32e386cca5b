"""Baselines on the terminal."""

from collections.abc import Mapping, Sequence

from logger.core.utc import utc_text
from postproc.baseline.store import StoredWalk
from postproc.terminal import print_text, screen, table

_DIGEST_SHOWN = 8
"""Characters, which name a walk well enough."""


def print_baseline(name: str, walks: Sequence[StoredWalk], trust: Mapping[str, str]) -> None:
    """Walks and trusted cells."""
    console = screen()
    print_text(console, f"{name}: {len(walks)} walk{'s' * (len(walks) != 1)}", "bold")
    titles = ("walk", "digest", "began (UTC)", "readings", "squares", "cells", "run")
    rows = [
        (
            str(walk.id),
            walk.digest[:_DIGEST_SHOWN],
            "unknown" if walk.began_utc_ns is None else utc_text(walk.began_utc_ns)[:16],
            str(walk.n_readings),
            str(walk.n_squares),
            str(walk.n_cells),
            walk.name,
        )
        for walk in walks
    ]
    table(console, titles, rows, right=("walk", "readings", "squares", "cells"))
    for cell, note in trust.items():
        print_text(console, f"{cell}: {note}", bullet="trusted: ")
