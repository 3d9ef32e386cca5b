"""The commands `verify` and `celldb` of `postproc`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import click

from logger.command_line import FILE, INPUT, json_option, late_modules, show
from logger.core.errors import ConfigError
from postproc.options import (
    area_options,
    false_alarm_option,
    grouped_runs,
    only_one,
    prior_options,
    runs_argument,
    stored_result,
)

with late_modules():
    from logger.core import document, places, runfile
    from logger.core.model import prior as priors
    from postproc import atomic_write, cell_work, ground, multi_run, progress, scan_counts
    from postproc import result as estimation
    from postproc.verification import celldb as databases
    from postproc.verification import (
        claims,
        run_claims,
        run_sites,
    )

_USUAL_M = 1000.0
"""Around `--near`."""


def tested_claims(
    result: estimation.Result,
    cells: Sequence[str | None],
    prior: priors.Prior,
    p_fa: float,
    texts: Sequence[str],
    path: Path | None,
) -> claims.Verified | None:
    """The claims of `--claim` and `--claims` about some cells (None: every cell), tested.

    `result` is that of the run with this prior. None without claims.
    """
    if not texts and path is None:
        return None
    runs, only = [one.run for one in result.runs], [cell for cell in cells if cell] or None
    claimed = [claims.parse_claim(text, cell) for text in texts for cell in cells]
    return run_claims.verify_claims(
        runs, claimed, p_fa, prior, only,
        file=path, result=result, progress=progress.with_progress,
    )  # fmt: skip


@click.command
@runs_argument
@click.option(
    "--claim",
    "texts",
    multiple=True,
    metavar="LAT,LON[,SIGMA_M]",
    help="Claimed position of --cell or every cell (repeatable).",
)
@click.option(
    "--claims",
    "claims_path",
    type=INPUT,
    metavar="FILE",
    help="CSV (cell,lat,lon[,sigma_m]), cell export or cells.db.",
)
@click.option("--sites", is_flag=True, help="Test whether --cell has one transmitter or two.")
@click.option("--cell", metavar="NAME", help="Only this cell.")
@click.option(
    "--against", type=INPUT, metavar="RUN", help="With --sites: a second run of the same cell."
)
@false_alarm_option
@prior_options
@area_options
@json_option
def verify(
    paths: Sequence[Path],
    texts: Sequence[str],
    claims_path: Path | None,
    cell: str | None,
    against: Path | None,
    p_fa: float,
    prior: priors.Prior,
    *,
    sites: bool,
    as_json: bool,
) -> int:
    """Test claimed positions of cells.

    Each is consistent, rejected or cannot be decided, by all runs together; what they would notice
    is printed first. The exit code is 3 if a test failed.
    """
    named = {"--claim": texts or None, "--claims": claims_path, "--sites": sites}
    only_one(named, is_required=True)
    only = [cell] if cell else []
    if sites:
        if len(paths) > 1:
            raise ConfigError("--sites tests one run; a second one goes with --against")
        if prior.area is not None:
            raise ConfigError("--sites asks the readings alone: it takes no area")
        run, *other = map(runfile.read_sound_run, [*paths, *([against] if against else [])])
        multi_run.check_different([run, *other])
        return _verify_sites(run, other[0] if other else None, only, p_fa, prior, as_json=as_json)
    if against is not None:
        raise ConfigError("--against goes with --sites")
    groups = grouped_runs(paths, only, prior.area)
    found = [
        run_claims.verify_claims(
            group.runs,
            [claims.parse_claim(text, cell) for text in texts],
            p_fa,
            prior,
            group.cells,
            file=claims_path,
            result=stored_result(group.runs, group.cells, estimation.Options(prior)),
            progress=progress.with_progress,
        )
        for group in groups
    ]
    documents = list(map(claims.document_of, found))
    show(ground.document_of_groups(groups, documents), as_json=as_json)
    return cell_work.exit_code([one for verified in found for one in verified.cells])


def _verify_sites(
    run: runfile.Run,
    other: runfile.Run | None,
    only: Sequence[str],
    p_fa: float,
    prior: priors.Prior,
    *,
    as_json: bool,
) -> int:
    names = list(scan_counts.observed_cells([run], only))
    if other is not None and not only:
        in_other = scan_counts.observed_cells([other], None)
        names = [name for name in names if name in in_other]
    cells = [
        run_sites.site_verdict(run, name, other, prior, p_fa)
        for name in progress.with_progress(names, "one place or two:", len(names), names)
    ]
    show(claims.document_of_sites(cells, p_fa), as_json=as_json)
    return cell_work.exit_code(cells)


@click.group(no_args_is_help=False)
def celldb() -> None:
    """Keep OpenCelliD and Mozilla exports as one indexed file."""


@celldb.command("import")
@click.argument("paths", type=INPUT, nargs=-1, required=True, metavar="FILE...")
@click.option("-o", "--output", type=FILE, required=True, metavar="CELLS.DB")
@json_option
def import_exports(paths: Sequence[Path], output: Path, *, as_json: bool) -> None:
    """Add exports to a database file.

    FILE is a world, country or MLS export, .gz or plain.
    """
    atomic_write.check_writable(output)
    imported = databases.import_exports(paths, output, progress.with_progress)
    text = (
        f"{imported.path}: {document.number_of(imported.n_cells, 'cell')}; "
        f"{document.number_of(imported.n_rows, 'row')} read, "
        f"{imported.n_bad} bad, {imported.n_replaced} replaced by newer ones"
    )
    remarks = [f"{bad.file}: row {bad.row} is no cell: {bad.text}" for bad in imported.bad_rows]
    show(document.Document(imported, body=[text], remarks=remarks), as_json=as_json)


@celldb.command
@click.argument("path", type=INPUT, metavar="CELLS.DB")
@click.option("--cell", "identity", metavar="MCC-MNC-AREA-CID")
@click.option(
    "--near",
    metavar="LAT,LON[,RADIUS_M]",
    help="Nearest first, at most 100 (default radius: 1000 m).",
)
@json_option
def lookup(path: Path, identity: str | None, near: str | None, *, as_json: bool) -> None:
    """Find cells by identity or around a position."""
    only_one({"--cell": identity, "--near": near}, is_required=True)
    database = databases.CellDb(path)
    if identity:
        cells = database.by_identity(identity)
    else:
        at, radius_m = places.position_of(near or "", "RADIUS_M")
        cells = database.near(at.lat, at.lon, _USUAL_M if radius_m is None else radius_m)
    database.close()
    show(databases.document_of_cells(cells), as_json=as_json)
