"""The commands `verify`, `verify-theory` and `celldb` of `postproc`."""

import argparse
import re
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from logger.core.arguments import file_path, height, input_path, whole
from logger.core.errors import ConfigError
from postproc.atomic_write import check_writable

if TYPE_CHECKING:
    from logger.core.model.prior import Prior
    from logger.core.runfile import Run
    from postproc.verification.claims import Claim
    from postproc.verification.run_claims import Verified


def add_verify(verify: argparse.ArgumentParser) -> None:
    what = verify.add_mutually_exclusive_group(required=True)
    what.add_argument(
        "--claim", metavar="LAT,LON[,SIGMA_M]", help="claimed position, of --cell or of every cell"
    )
    what.add_argument(
        "--claims",
        type=input_path,
        metavar="FILE",
        help="CSV (cell,lat,lon[,sigma_m]), cell export or cells.db",
    )
    what.add_argument(
        "--sites", action="store_true", help="is --cell heard from one place or from two?"
    )
    southern(verify)
    verify.add_argument("--cell", metavar="NAME", help="only this cell")
    verify.add_argument(
        "--against",
        type=input_path,
        metavar="RUN",
        help="with --sites: a second run of the same cell",
    )
    verify.add_argument(
        "--pfa", type=float, default=0.05, metavar="P", help="false-alarm rate (default: 0.05)"
    )
    verify.add_argument(
        "--environment", default="any", help="prior: any (default), open, suburban or urban"
    )
    verify.add_argument(
        "--height",
        type=height("--height"),
        metavar="M",
        help="antenna above the receiver (default: 5 m)",
    )
    verify.add_argument("--json", action="store_true")
    verify.set_defaults(command=_verify_claims)


def add_claims(parser: argparse.ArgumentParser) -> None:
    """Options of a command that also tests claims, for `verified`."""
    southern(parser)
    what = "claimed position, of --cell or of every cell (may be repeated)"
    parser.add_argument("--claim", action="append", metavar="LAT,LON[,SIGMA_M]", help=what)
    what = "claims: CSV, cell export or cells.db, as for verify"
    parser.add_argument("--claims", type=input_path, metavar="FILE", help=what)


def verified(
    arguments: argparse.Namespace,
    run: "Run",
    cells: Sequence[str | None],
    p_fa: float,
    prior: "Prior",
) -> "Verified | None":
    """What a run says of the claims asked for about some cells (None: every cell); None where none
    were.
    """
    from postproc.smoothing import observed_cells
    from postproc.verification.claims import parse_claim, read_claims

    if not arguments.claim and not arguments.claims:
        return None
    found = [parse_claim(text, cell) for text in arguments.claim or () for cell in cells]
    if arguments.claims:
        found += read_claims(
            arguments.claims, list(observed_cells([run], [cell for cell in cells if cell] or None))
        )
    return _tested(run, found, p_fa, prior, [cell for cell in cells if cell] or None)


def _tested(
    run: "Run", claims: "Sequence[Claim]", p_fa: float, prior: "Prior", only: Sequence[str] | None
) -> "Verified":
    from postproc.progress import shown
    from postproc.verification.run_claims import Verification

    verification = Verification(run, claims, p_fa, prior, only)
    names = [cell for cell, _ in verification.pairs]
    return verification.adjusted(list(shown(verification.each(), "verifying", len(names), names)))


def southern(parser: argparse.ArgumentParser) -> None:
    """Let an argument begin with the minus of a coordinate, as a latitude south of the equator
    does.
    """
    parser._negative_number_matcher = re.compile(r"-[\d.]")  # noqa: SLF001 (argparse has no other way)


def add_theory(theory: argparse.ArgumentParser) -> None:
    southern(theory)
    theory.add_argument(
        "--pfa", type=float, default=0.05, metavar="P", help="false-alarm rate (default: 0.05)"
    )
    theory.add_argument(
        "--receivers",
        nargs="+",
        metavar="X,Y[,Z]",
        help="metres from the true place (default: ours)",
    )
    theory.add_argument(
        "--sigma", type=float, nargs="+", metavar="M", help="of a range (default: 100 and 20000 m)"
    )
    theory.add_argument(
        "--trials", type=int, default=20_000, metavar="N", help="simulated claims (default: 20000)"
    )
    theory.add_argument("--seed", type=whole("--seed", 0, 2**63 - 1), default=0, metavar="N")
    theory.add_argument("--json", action="store_true")
    theory.set_defaults(command=_verify_theory)


def add_celldb(celldb: argparse.ArgumentParser) -> None:
    commands = celldb.add_subparsers(required=True, metavar="COMMAND")
    imports = commands.add_parser("import", help="add exports to a database file")
    imports.add_argument(
        "file",
        type=input_path,
        nargs="+",
        metavar="FILE",
        help="world, country or MLS export, .gz or plain",
    )
    imports.add_argument("-o", "--output", type=file_path, required=True, metavar="CELLS.DB")
    imports.add_argument("--json", action="store_true")
    imports.set_defaults(command=_celldb_import)
    lookup = commands.add_parser("lookup", help="cells by identity or around a place")
    southern(lookup)
    lookup.add_argument("db", type=input_path, metavar="CELLS.DB")
    which = lookup.add_mutually_exclusive_group(required=True)
    which.add_argument("--cell", metavar="MCC-MNC-AREA-CID")
    which.add_argument(
        "--near", metavar="LAT,LON[,RADIUS_M]", help="nearest first, at most 100 (default: 1000 m)"
    )
    lookup.add_argument("--json", action="store_true")
    lookup.set_defaults(command=_celldb_lookup)


def _verify_claims(arguments: argparse.Namespace) -> int:
    from logger.core.model.prior import prior_for
    from logger.core.runfile import read_sound_run
    from postproc.json_text import as_json
    from postproc.smoothing import observed_cells
    from postproc.verification import claims, tables

    run, prior = (
        read_sound_run(arguments.run),
        prior_for(arguments.environment, height_m=arguments.height),
    )
    if arguments.sites:
        return _verify_sites(arguments, run, prior)
    if arguments.against is not None:
        raise ConfigError("--against goes with --sites")
    heard = observed_cells([run], arguments.cell and [arguments.cell])
    if arguments.claim is not None:
        found = [claims.parse_claim(arguments.claim, arguments.cell)]
    else:
        found = claims.read_claims(arguments.claims, list(heard))
    tested = _tested(run, found, arguments.pfa, prior, arguments.cell and [arguments.cell])
    if arguments.json:
        print(as_json(tables.as_dict(tested)))
    else:
        tables.print_verified(tested)
    return 0


def _verify_sites(arguments: argparse.Namespace, run: "Run", prior: "Prior") -> int:
    from logger.core.runfile import read_sound_run
    from postproc.json_text import as_json
    from postproc.progress import shown
    from postproc.smoothing import observed_cells
    from postproc.verification import tables
    from postproc.verification.run_claims import sites_of

    other = read_sound_run(arguments.against) if arguments.against is not None else None
    heard = observed_cells([run], arguments.cell and [arguments.cell])
    if other is not None and not arguments.cell:
        both = observed_cells([other], None)
        heard = {cell: n for cell, n in heard.items() if cell in both}
    cells = shown(heard, "one place or two:", len(heard), list(heard))
    found = [
        tables.sites_dict(cell, *sites_of(run, cell, other, prior), arguments.pfa) for cell in cells
    ]
    if arguments.json:
        print(as_json({"p_fa": arguments.pfa, "cells": found}))
    else:
        for cell_found in found:
            tables.print_sites(cell_found)
    return 0


def _verify_theory(arguments: argparse.Namespace) -> int:
    from postproc.json_text import as_json
    from postproc.reproductions.position_verification import report, tables

    receivers = report.places(arguments.receivers) if arguments.receivers else None
    sigmas_m = arguments.sigma or report.SIGMAS_M
    found = report.summary(arguments.pfa, receivers, sigmas_m, arguments.trials, arguments.seed)
    if arguments.json:
        print(as_json(found))
    else:
        tables.print_theory(found)
    return 0


def _celldb_import(arguments: argparse.Namespace) -> int:
    from dataclasses import asdict

    from postproc.json_text import as_json
    from postproc.progress import shown
    from postproc.verification.celldb import CellImport

    check_writable(arguments.output)
    work = CellImport(arguments.file, arguments.output)
    names = [path.name for path in arguments.file for _ in range(100)]
    for _ in shown(work, "importing", len(names), names):
        pass
    imported = work.imported
    if imported is None:
        return 1
    for bad in imported.bad_rows:
        print(f"{bad.file}: row {bad.row} is no cell: {bad.text}", file=sys.stderr)
    if arguments.json:
        print(as_json(asdict(imported) | {"path": str(imported.path)}))
    else:
        print(
            f"{imported.path}: {imported.n_cells} cells; {imported.n_rows} rows read, {imported.n_bad} bad, "
            f"{imported.n_replaced} replaced by newer ones"
        )
    return 0


def _celldb_lookup(arguments: argparse.Namespace) -> int:
    from dataclasses import asdict

    from postproc.json_text import as_json
    from postproc.verification import tables
    from postproc.verification.celldb import CellDb
    from postproc.verification.parsing import place_of

    database = CellDb(arguments.db)
    found = (
        database.by_identity(arguments.cell)
        if arguments.cell
        else database.near(*place_of(arguments.near))
    )
    database.close()
    if arguments.json:
        print(as_json({"cells": [asdict(cell) for cell in found], "absence_is_an_alarm": False}))
    else:
        tables.print_cells(found)
    return 0
