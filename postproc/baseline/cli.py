"""The commands `postproc baseline ...`."""

import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path

import click

from logger.command_line import FILE, json_option
from postproc.options import runs_argument

DEFAULT_NAME = "baseline.db"

baseline_option: Callable[..., Callable[..., int | None]] = click.option(
    "-b",
    "--baseline",
    "target",
    type=FILE,
    default=DEFAULT_NAME,
    show_default=True,
    metavar="FILE",
    help="The baseline.",
)


@click.group(no_args_is_help=False)
def baseline() -> None:
    """Keep what earlier walks heard, to compare later walks with.

    A baseline is one file: cells and their levels by walk and square of 300 m.
    """


@baseline.command
@runs_argument
@baseline_option
@json_option
def add(paths: Sequence[Path], target: Path, *, as_json: bool) -> int:
    """Add runs; the file is made if there is none.

    A run that is in the baseline is not added again. One that was altered since it was sealed is
    not added. The exit code is 3 if a run could not be added.
    """
    from logger.core.errors import SOMETHING_LOST
    from logger.core.printable import printable
    from postproc.baseline.addition import add_runs
    from postproc.baseline.store import BaselineStore
    from postproc.json_text import as_json as json_text
    from postproc.progress import with_progress

    with BaselineStore(target, create=True) as store:
        work = add_runs(store, paths)
        names = [path.name for path in paths]
        results = list(with_progress(work, "adding", len(paths), names))
        n_walks, n_cells = len(store.walks()), store.n_cells()
    failed = [result for result in results if result.problem]
    for result in failed:
        print(
            f"{printable(str(result.path))} was not added: {printable(result.problem)}",
            file=sys.stderr,
        )
    for result in results:
        if result.remark:
            print(f"{printable(str(result.path))}: {result.remark}", file=sys.stderr)
    if as_json:
        runs = [asdict(result) | {"path": str(result.path)} for result in results]
        print(
            json_text({"baseline": str(target), "walks": n_walks, "cells": n_cells, "runs": runs})
        )
    else:
        n_known = sum(result.is_known for result in results)
        n_added = len(results) - n_known - len(failed)
        known = f", {n_known} in it already" if n_known else ""
        walks = f"{n_walks} walk{'s' * (n_walks != 1)}"
        print(f"{target}: {n_added} added{known}; {walks}, {n_cells} cells")
    return SOMETHING_LOST if failed else 0


@baseline.command("list")
@baseline_option
@json_option
def list_walks(target: Path, *, as_json: bool) -> None:
    """Print the walks and the trusted cells."""
    from postproc.baseline.store import BaselineStore
    from postproc.baseline.tables import print_baseline
    from postproc.json_text import as_json as json_text

    with BaselineStore(target) as store:
        walks, trust, n_cells = store.walks(), store.trusted_cells(), store.n_cells()
    if as_json:
        trusted = [{"cell": cell, "note": note} for cell, note in trust.items()]
        rows = [asdict(walk) for walk in walks]
        document = {"baseline": str(target), "cells": n_cells, "walks": rows, "trusted": trusted}
        print(json_text(document))
    else:
        print_baseline(str(target), walks, trust)


@baseline.command
@click.argument("cell", metavar="CELL")
@click.argument("note", metavar="NOTE", default="")
@click.option("--withdraw", is_flag=True, help="Trust the cell no longer.")
@baseline_option
@json_option
def trust(cell: str, note: str, target: Path, *, withdraw: bool, as_json: bool) -> None:
    """Trust a cell that you know, with a NOTE that says why.

    CELL is its name, mcc-mnc-area-cid. It stays trusted when walks are added or removed.
    """
    from logger.core.errors import ConfigError
    from postproc.baseline.store import BaselineStore
    from postproc.json_text import as_json as json_text
    from postproc.verification.parsing import identity_of

    if identity_of(cell) is None:
        raise ConfigError(f"{cell!r} is no cell: mcc-mnc-area-cid is wanted, like 262-01-801-86355")
    if withdraw == bool(note):
        raise ConfigError("give a note that says why the cell is trusted, or --withdraw")
    with BaselineStore(target) as store:
        if not withdraw:
            store.trust(cell, note)
        elif not store.distrust(cell):
            raise ConfigError(f"{cell} is not trusted")
    if as_json:
        print(json_text({"cell": cell, "trusted": not withdraw, "note": note or None}))
    else:
        print(f"{cell} is trusted{' no longer' if withdraw else f': {note}'}")


@baseline.command
@click.argument("walks", nargs=-1, required=True, metavar="WALK...")
@baseline_option
@json_option
def remove(walks: Sequence[str], target: Path, *, as_json: bool) -> None:
    """Remove walks.

    WALK is a number or the beginning of a digest, as `list` prints them. Trusted cells stay.
    """
    from postproc.baseline.store import BaselineStore
    from postproc.json_text import as_json as json_text

    with BaselineStore(target) as store:
        chosen = {walk.id: walk for walk in map(store.walk_of, walks)}
        store.remove(list(chosen))
        n_left = len(store.walks())
    if as_json:
        removed = [asdict(walk) for walk in chosen.values()]
        print(json_text({"baseline": str(target), "removed": removed, "walks": n_left}))
    else:
        print(f"{target}: {len(chosen)} removed, {n_left} left")
