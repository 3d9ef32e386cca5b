"""The commands `postproc baseline ...`."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from shlex import quote

import click

from logger.command_line import FILE, json_option, late_modules, run_now, show
from logger.core.errors import SOMETHING_LOST, ConfigError, FieldLoggerError
from postproc.options import runs_argument

with late_modules():
    from logger import baseline_store, own_baseline
    from logger.core import cell_names, document, runfile, types
    from postproc import processes, progress

DEFAULT_NAME = "baseline.db"
_DIGEST_SHOWN = 8
"""Characters, which name a walk well enough."""

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


def add_runs(
    store: "baseline_store.BaselineStore", paths: Sequence[Path]
) -> "Iterator[baseline_store.Added]":
    """Add each run that is not in the baseline, and yield what became of it, in order.

    Each run is durable when it is yielded. A run that cannot be read does not stop the others.
    """
    run_now(own_baseline)  # its first use would be in several threads at once
    for path, outcome in processes.read_ahead(paths, _summary):
        if isinstance(outcome, FieldLoggerError):
            yield baseline_store.add_walk(store, path, outcome)
            continue
        walk, conspicuous = outcome
        added = baseline_store.add_walk(store, path, walk)
        doubtful = sorted(conspicuous - store.trusted_cells().keys())
        if added.walk is not None and doubtful:  # later walks will not be warned of them
            known = _KNOWN_NOW.format(", ".join(doubtful), added.walk, _option(store.path))
            remark = "; ".join(filter(None, [added.remark, known]))
            added = replace(added, remark=remark)
        yield added


_KNOWN_NOW = (
    "unusual or suspicious on it, and known from now on: {}; `postproc baseline remove {}{}` "
    "undoes that"
)


def _option(path: Path) -> str:
    return "" if path == Path(DEFAULT_NAME) else f" -b {quote(str(path))}"


def _summary(run: "runfile.Run") -> "tuple[baseline_store.WalkSummary, set[str]]":
    return baseline_store.summarise_walk(run), own_baseline.conspicuous_cells(run)


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

    A run that is in the baseline, or was altered since it was sealed, is not added. The exit code
    is 3 if a run could not be added.
    """
    with baseline_store.BaselineStore(target, create=True) as kept:
        work = add_runs(kept, paths)
        names = [path.name for path in paths]
        results = list(progress.with_progress(work, "adding", len(paths), names))
        n_walks, n_cells = len(kept.walks()), kept.n_cells()
    failed = [result for result in results if result.problem]
    n_known = sum(result.is_known for result in results)
    n_added = len(results) - n_known - len(failed)
    known = f", {n_known} in it already" if n_known else ""
    walks = document.number_of(n_walks, "walk")
    content = {"baseline": target, "walks": n_walks, "cells": n_cells, "runs": results}
    said = document.Document(
        content,
        body=[f"{target}: {n_added} added{known}; {walks}, {document.number_of(n_cells, 'cell')}"],
        remarks=[
            *(f"{result.path} was not added: {result.problem}" for result in failed),
            *(f"{result.path}: {result.remark}" for result in results if result.remark),
        ],
    )
    show(said, as_json=as_json)
    return SOMETHING_LOST if failed else 0


@baseline.command("list")
@baseline_option
@json_option
def list_walks(target: Path, *, as_json: bool) -> None:
    """Print the walks and the trusted cells."""
    with baseline_store.BaselineStore(target) as kept:
        walks, trust, n_cells = kept.walks(), kept.trusted_cells(), kept.n_cells()
    trusted = [{"cell": cell, "note": note} for cell, note in trust.items()]
    content = {"baseline": target, "cells": n_cells, "walks": walks, "trusted": trusted}
    columns = [
        document.Column("walk", "d"),
        document.Column("digest"),
        document.Column("began (UTC)"),
        document.Column("readings", "d"),
        document.Column("squares", "d"),
        document.Column("cells", "d"),
        document.Column("run"),
    ]
    rows = [
        (
            walk.id,
            walk.digest[:_DIGEST_SHOWN],
            "unknown" if walk.began_utc_ns is None else types.utc_text(walk.began_utc_ns)[:16],
            walk.n_readings,
            walk.n_squares,
            walk.n_cells,
            walk.name,
        )
        for walk in walks
    ]
    said = document.Document(
        content,
        f"{target}: {document.number_of(len(walks), 'walk')}",
        body=[
            document.Table(columns, rows),
            *(document.Line(f"{cell}: {note}", bullet="trusted: ") for cell, note in trust.items()),
        ],
    )
    show(said, as_json=as_json)


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
    if cell_names.identity_of(cell) is None:
        raise ConfigError(f"{cell!r} is no cell: mcc-mnc-area-cid is wanted, like 262-01-801-86355")
    if withdraw == bool(note):
        raise ConfigError("give a note that says why the cell is trusted, or --withdraw")
    with baseline_store.BaselineStore(target) as kept:
        if not withdraw:
            kept.trust(cell, note)
        elif not kept.distrust(cell):
            raise ConfigError(f"{cell} is not trusted")
        is_known = withdraw or kept.has_heard(cell)
    remarks = [] if is_known else [f"no walk of {target} has heard {cell}: is every digit right?"]
    content = {"cell": cell, "trusted": not withdraw, "note": note or None}
    text = f"{cell} is trusted{' no longer' if withdraw else f': {note}'}"
    show(document.Document(content, body=[text], remarks=remarks), as_json=as_json)


@baseline.command
@click.argument("walks", nargs=-1, required=True, metavar="WALK...")
@baseline_option
@json_option
def remove(walks: Sequence[str], target: Path, *, as_json: bool) -> None:
    """Remove walks.

    WALK is a number or the beginning of a digest, as `list` prints them. Trusted cells stay.
    """
    with baseline_store.BaselineStore(target) as kept:
        chosen = {walk.id: walk for walk in map(kept.walk_of, walks)}
        kept.remove(list(chosen))
        n_left = len(kept.walks())
    content = {"baseline": target, "removed": list(chosen.values()), "walks": n_left}
    text = f"{target}: {len(chosen)} removed, {n_left} left"
    show(document.Document(content, body=[text]), as_json=as_json)
