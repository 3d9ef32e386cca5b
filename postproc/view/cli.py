"""The command `view` of `postproc`."""

import argparse
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from logger.core.errors import ConfigError

_P_FA = 0.05

if TYPE_CHECKING:
    from logger.core.runfile import Run
    from postproc.smooth import CellResult
    from postproc.verify.run import CellVerdict
    from postproc.view.story import Estimated, Story


def add_view(view: argparse.ArgumentParser) -> None:
    # lets a claim begin with the minus of a southern latitude; argparse has no other way
    view._negative_number_matcher = re.compile(r"-[\d.]")  # noqa: SLF001
    view.add_argument("--cell", action="append", metavar="NAME", help="cell to tell in full (may be repeated)")
    view.add_argument("--claim", action="append", metavar="LAT,LON[,SIGMA_M]", help="claimed position to be tested")
    view.add_argument("--claims", type=Path, metavar="FILE", help="claims: CSV, cell export or cells.db, as for verify")
    view.add_argument(
        "--basemap",
        type=Path,
        metavar="FILE",
        help="under the plan: PNG or JPEG with a world file, GeoPackage, MBTiles",
    )
    where = view.add_mutually_exclusive_group()
    where.add_argument("--save", type=Path, metavar="RUN.RRD", help="write the recording instead of opening the viewer")
    where.add_argument("--web", action="store_true", help="serve it to a browser on this machine, until Ctrl-C")
    view.add_argument("--port", type=int, metavar="N", help="of --web (default: one that is free)")
    view.set_defaults(command=_view)


def _view(arguments: argparse.Namespace) -> int:
    from logger.core.runfile import read_run
    from postproc.view.basemap import read_basemap
    from postproc.view.scene import write_scene
    from postproc.view.viewer import show
    from postproc.view.web import serve

    _check(arguments)
    runs = [read_run(path) for path in arguments.run]

    def write(path: Path) -> None:
        """Estimate and draw, after it is known that the result can be shown."""
        story = _story(arguments, runs)
        basemap = read_basemap(arguments.basemap, story) if arguments.basemap else None
        write_scene(story, path, basemap=basemap, online=not arguments.web)

    if arguments.web:
        return serve(write, arguments.port or 0, lambda address: print(f"{address} - Ctrl-C ends it", flush=True))
    if arguments.save is None:
        return show(write, runs[0].path.stem)
    write(arguments.save)
    print(arguments.save)
    return 0


def _check(arguments: argparse.Namespace) -> None:
    """Tell of mistakes at once, not after the minute that estimating may take."""
    from postproc.verify.claims import parse_claim

    if arguments.save is not None and arguments.save.suffix != ".rrd":
        raise ConfigError(f"{arguments.save}: a rerun recording is named .rrd")
    if arguments.port is not None and not arguments.web:
        raise ConfigError("--port goes with --web")
    if arguments.basemap is not None and not arguments.basemap.is_file():
        raise ConfigError(f"{arguments.basemap}: no such file")
    for text in arguments.claim or ():
        parse_claim(text, None)
    if len(arguments.run) > 1 and (arguments.claim or arguments.claims):
        raise ConfigError("claims are tested against one run: give one, or leave the claims out")


def _story(arguments: argparse.Namespace, runs: Sequence["Run"]) -> "Story":
    from postproc.progress import shown
    from postproc.smooth import Wishes
    from postproc.view.story import chosen, story_of
    from postproc.view.unfolding import MOST_STEPS, unfold

    found = _estimated(runs, arguments.cell)
    subjects = chosen(found, arguments.cell)
    claims = _claims(arguments, found, subjects)
    told = []
    for result in subjects:
        steps = unfold(result, Wishes().prior, _processes())
        steps_shown = shown(steps, f"how the answer for {result.cell} came about", MOST_STEPS)
        told.append((result, tuple(steps_shown), claims.get(result.cell, ())))
    return story_of(found, told)


def _estimated(runs: Sequence["Run"], only: Sequence[str] | None) -> "Estimated":
    from postproc.progress import shown
    from postproc.smooth import smooth_run
    from postproc.together import smooth_together
    from postproc.view.clock import end_to_end
    from postproc.view.story import of_one, of_several

    if len(runs) == 1:
        return of_one(smooth_run(runs[0], only, progress=shown, processes=_processes()))
    return of_several(smooth_together(end_to_end(runs), only, progress=shown, processes=_processes()))


def _claims(
    arguments: argparse.Namespace, found: "Estimated", subjects: Sequence["CellResult"]
) -> dict[str, tuple["CellVerdict", ...]]:
    """Claims about the cells told in full, tested, by cell."""
    from postproc.progress import shown
    from postproc.smooth import Wishes
    from postproc.verify.claims import parse_claim, read_claims
    from postproc.verify.run import Verification

    if not arguments.claim and not arguments.claims:
        return {}
    cells = [subject.cell for subject in subjects]
    claims = [parse_claim(text, cell) for text in arguments.claim or () for cell in cells]
    if arguments.claims:
        read = read_claims(arguments.claims, cells)
        if not read:
            raise ConfigError(f"{arguments.claims} claims nothing about {', '.join(cells) or 'any cell'}; see --cell")
        claims += read
    verification = Verification(found.runs[0], claims, _P_FA, Wishes().prior)
    tested = list(shown(verification.each(), "verifying", len(verification.pairs)))
    verdicts = verification.adjusted(tested).cells
    return {cell: tuple(one for one in verdicts if one.cell == cell) for cell in cells}


def _processes() -> int:
    return os.cpu_count() or 1
