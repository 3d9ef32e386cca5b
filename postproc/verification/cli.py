"""The commands `verify` and `celldb` of `postproc`."""

import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from logger.command_line import FILE, INPUT, json_option
from logger.core.errors import ConfigError
from postproc.options import (
    false_alarm_option,
    only_one,
    prior_options,
    run_argument,
    stored_result,
)

if TYPE_CHECKING:
    from logger.core.model.prior import Prior
    from logger.core.runfile import Run
    from postproc.result import Result
    from postproc.verification.claims import Claim
    from postproc.verification.verdicts import Verified


@dataclass(frozen=True, slots=True)
class ClaimOptions:
    """Claims that a command tests beside its main work, from its options `--claim`, `--claims`."""

    texts: Sequence[str]
    path: Path | None
    p_fa: float

    def __bool__(self) -> bool:
        return bool(self.texts or self.path)

    def test(
        self, result: "Result", cells: Sequence[str | None], prior: "Prior"
    ) -> "Verified | None":
        """Test the claims about some cells (None: every cell); None without claims.

        `result` is that of the run with this prior.
        """
        from postproc.scan_counts import observed_cells
        from postproc.verification.claims import parse_claim, read_claims

        if not self:
            return None
        run, only = result.runs[0].run, [cell for cell in cells if cell] or None
        claims = [parse_claim(text, cell) for text in self.texts for cell in cells]
        if self.path:
            claims += read_claims(self.path, list(observed_cells([run], only)))
        return _test(run, claims, self.p_fa, prior, only, result)


def _test(
    run: "Run",
    claims: "Sequence[Claim]",
    p_fa: float,
    prior: "Prior",
    only: Sequence[str] | None,
    result: "Result | None",
) -> "Verified":
    from postproc.progress import with_progress
    from postproc.verification.run_claims import verify_claims

    return verify_claims(
        run,
        claims,
        p_fa,
        prior,
        only,
        is_simulated=bool(run.meta.truth),
        result=result,
        progress=with_progress,
    )


@click.command
@run_argument
@click.option(
    "--claim", metavar="LAT,LON[,SIGMA_M]", help="Claimed position of --cell or of every cell."
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
@json_option
def verify(
    path: Path,
    claim: str | None,
    claims_path: Path | None,
    cell: str | None,
    against: Path | None,
    p_fa: float,
    prior: "Prior",
    *,
    sites: bool,
    as_json: bool,
) -> int:
    """Test claimed positions of cells.

    Each is consistent, rejected or cannot be decided; the power of the test is printed too. The
    exit code is 3 if the test of a cell failed.
    """
    from logger.core.runfile import read_sound_run
    from postproc.cell_work import exit_code
    from postproc.json_text import as_json as json_text
    from postproc.result import Options
    from postproc.scan_counts import observed_cells
    from postproc.verification import tables
    from postproc.verification.claims import parse_claim, read_claims

    only_one({"--claim": claim, "--claims": claims_path, "--sites": sites}, is_required=True)
    run, only = read_sound_run(path), [cell] if cell else None
    if sites:
        other = read_sound_run(against) if against is not None else None
        return _verify_sites(run, other, only, p_fa, prior, as_json=as_json)
    if against is not None:
        raise ConfigError("--against goes with --sites")
    observed = observed_cells([run], only)
    if claim is not None:
        claims = [parse_claim(claim, cell)]
    elif claims_path is not None:
        claims = read_claims(claims_path, list(observed))
    result = stored_result([run], only or [], Options(prior))
    verified = _test(run, claims, p_fa, prior, only, result)
    if as_json:
        print(json_text(tables.as_dict(verified)))
    else:
        tables.print_verified(verified)
    return exit_code(verified.cells)


def _verify_sites(
    run: "Run",
    other: "Run | None",
    only: Sequence[str] | None,
    p_fa: float,
    prior: "Prior",
    *,
    as_json: bool,
) -> int:
    from postproc.cell_work import exit_code
    from postproc.json_text import as_json as json_text
    from postproc.progress import with_progress
    from postproc.scan_counts import observed_cells
    from postproc.verification import tables
    from postproc.verification.run_sites import site_verdict

    names = list(observed_cells([run], only))
    if other is not None and not only:
        in_other = observed_cells([other], None)
        names = [name for name in names if name in in_other]
    cells = [
        site_verdict(run, name, other, prior, p_fa)
        for name in with_progress(names, "one place or two:", len(names), names)
    ]
    if as_json:
        print(json_text({"p_fa": p_fa, "cells": cells}))
    else:
        for cell in cells:
            tables.print_sites(cell)
    return exit_code(cells)


@click.group(no_args_is_help=False)
def celldb() -> None:
    """Keep OpenCelliD and Mozilla exports as one indexed file."""


@celldb.command("import")
@click.argument("paths", type=INPUT, nargs=-1, required=True, metavar="FILE...")
@click.option("-o", "--output", type=FILE, required=True, metavar="CELLS.DB")
@json_option
def import_exports(paths: Sequence[Path], output: Path, *, as_json: bool) -> int:
    """Add exports to a database file.

    FILE is a world, country or MLS export, .gz or plain.
    """
    from postproc.atomic_write import check_writable
    from postproc.json_text import as_json as json_text
    from postproc.progress import with_progress
    from postproc.verification.celldb_import import CellImport

    check_writable(output)
    work = CellImport(list(paths), output)
    names = [path.name for path in paths for _ in range(100)]
    for _ in with_progress(work, "importing", len(names), names):
        pass
    imported = work.imported
    if imported is None:
        return 1
    for bad in imported.bad_rows:
        print(f"{bad.file}: row {bad.row} is no cell: {bad.text}", file=sys.stderr)
    if as_json:
        print(json_text(asdict(imported) | {"path": str(imported.path)}))
    else:
        print(
            f"{imported.path}: {imported.n_cells} cells; {imported.n_rows} rows read, "
            f"{imported.n_bad} bad, {imported.n_replaced} replaced by newer ones"
        )
    return 0


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
    from postproc.json_text import as_json as json_text
    from postproc.verification import tables
    from postproc.verification.celldb import CellDb
    from postproc.verification.parsing import place_of

    only_one({"--cell": identity, "--near": near}, is_required=True)
    database = CellDb(path)
    cells = database.by_identity(identity) if identity else database.near(*place_of(near or ""))
    database.close()
    if as_json:
        print(json_text({"cells": [asdict(cell) for cell in cells], "absence_is_an_alarm": False}))
    else:
        tables.print_cells(cells)
