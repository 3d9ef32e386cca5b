"""The command `view` of `postproc`."""

import argparse
import json
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from logger.core.arguments import file_path, input_path, whole
from logger.core.errors import ConfigError
from postproc.atomic_write import check_output
from postproc.verification import cli as verify

_P_FA = 0.05

if TYPE_CHECKING:
    from logger.core.runfile import Run
    from postproc.result import CellResult
    from postproc.verification.run_claims import CellVerdict
    from postproc.view.view_model import ViewModel


def add_view(view: argparse.ArgumentParser) -> None:
    verify.add_claims(view)
    view.add_argument(
        "--cell", action="append", metavar="NAME", help="cell to tell in full (may be repeated)"
    )
    view.add_argument(
        "--basemap",
        type=input_path,
        metavar="FILE",
        help="under the plan: PNG or JPEG with a world file, GeoPackage, MBTiles",
    )
    where = view.add_mutually_exclusive_group()
    where.add_argument(
        "--save",
        type=file_path,
        metavar="RUN.RRD",
        help="write the recording instead of opening the viewer",
    )
    where.add_argument(
        "--web", action="store_true", help="serve it to a browser on this machine, until Ctrl-C"
    )
    view.add_argument(
        "--port",
        type=whole("--port", 0, 65_535),
        metavar="N",
        help="of --web (default: one that is free)",
    )
    view.add_argument(
        "--json", action="store_true", help="with --save: say what was written as JSON"
    )
    view.set_defaults(command=_view)


def _view(arguments: argparse.Namespace) -> int:
    from logger.core.runfile import read_sound_run
    from postproc.view.basemap import read_basemap
    from postproc.view.recording import is_recording
    from postproc.view.scene import write_scene
    from postproc.view.viewer import show

    _check(arguments)
    if any(map(is_recording, arguments.run)):
        return _show_recording(arguments)
    runs = [read_sound_run(path) for path in arguments.run]

    def write(path: Path) -> None:
        """Estimate and draw, after it is known that the result can be shown."""
        view = _view_model(arguments, runs)
        basemap = read_basemap(arguments.basemap, view) if arguments.basemap else None
        write_scene(view, path, basemap=basemap, online=not arguments.web)

    if arguments.web:
        return _serve(arguments, write)
    if arguments.save is None:
        return show(write, runs[0].path.stem)
    write(arguments.save)
    written = {"path": str(arguments.save), "bytes": arguments.save.stat().st_size}
    print(
        json.dumps(written)
        if arguments.json
        else f"{arguments.save}: `postproc view {arguments.save}` opens it"
    )
    return 0


def _show_recording(arguments: argparse.Namespace) -> int:
    """What `--save` has written, in the same viewers: bare `rerun` listens for everybody and counts
    its users.
    """
    from postproc.view.recording import copy_recording
    from postproc.view.viewer import show

    options = ("save", "claim", "claims", "cell", "basemap")
    if given := [f"--{name}" for name in options if getattr(arguments, name)]:
        raise ConfigError(f"{given[0]} goes with a run; {arguments.run[0]} is a recording already")
    write = copy_recording(arguments.run)
    return _serve(arguments, write) if arguments.web else show(write, arguments.run[0].stem)


def _serve(arguments: argparse.Namespace, write: Callable[[Path], None]) -> int:
    from postproc.view.web import serve

    return serve(
        write, arguments.port or 0, lambda address: print(f"{address} - Ctrl-C ends it", flush=True)
    )


def _check(arguments: argparse.Namespace) -> None:
    """Tell of mistakes at once, not after the minute that estimating may take."""
    from postproc.verification.claims import parse_claim

    if arguments.save is not None and arguments.save.suffix != ".rrd":
        raise ConfigError(f"{arguments.save}: a rerun recording is named .rrd")
    if arguments.save is not None:
        check_output(arguments.save)
    if arguments.port is not None and not arguments.web:
        raise ConfigError("--port goes with --web")
    if arguments.basemap is not None and not arguments.basemap.is_file():
        raise ConfigError(f"{arguments.basemap}: no such file")
    for text in arguments.claim or ():
        parse_claim(text, None)
    if len(arguments.run) > 1 and (arguments.claim or arguments.claims):
        raise ConfigError("claims are tested against one run: give one, or leave the claims out")


def _view_model(arguments: argparse.Namespace, runs: Sequence["Run"]) -> "ViewModel":
    from postproc.progress import shown
    from postproc.result import Options
    from postproc.smoothing import smooth_runs
    from postproc.view.end_to_end import end_to_end
    from postproc.view.timeline import MOST_STEPS, answer_steps
    from postproc.view.view_model import CellDetail, select_cells, view_model

    in_sequence = end_to_end(runs) if len(runs) > 1 else runs
    result = smooth_runs(in_sequence, arguments.cell, progress=shown, processes=_processes())
    cells = select_cells(result, arguments.cell)
    claims = _claims(arguments, in_sequence[0], cells)
    details = []
    for cell in cells:
        steps = answer_steps(cell, Options().prior, _processes())
        steps_shown = shown(steps, f"answer for {cell.cell} step by step", MOST_STEPS)
        details.append(CellDetail(cell, tuple(steps_shown), claims.get(cell.cell, ())))
    return view_model(result, details)


def _claims(
    arguments: argparse.Namespace, run: "Run", cells: Sequence["CellResult"]
) -> dict[str, tuple["CellVerdict", ...]]:
    """Verdicts on the claims about the cells in detail, by cell."""
    from postproc.result import Options

    names = [cell.cell for cell in cells]
    tested = verify.verified(arguments, run, names, _P_FA, Options().prior)
    if tested is None:
        return {}
    if not tested.cells:
        raise ConfigError(
            f"{arguments.claims} claims nothing about {', '.join(names) or 'any cell'}; see --cell"
        )
    return {name: tuple(one for one in tested.cells if one.cell == name) for name in names}


def _processes() -> int:
    return os.cpu_count() or 1
