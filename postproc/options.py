"""Options and arguments that several commands of `postproc` share, each declared once."""

from __future__ import annotations

import dataclasses
import functools
import itertools
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import click

from logger.command_line import INPUT, late_modules, number

with late_modules():
    from logger import street_file
    from logger.core import isolation, places, runfile
    from logger.core.locator import verdict
    from logger.core.model import area
    from logger.core.model import prior as priors
    from postproc import area_file, ground, multi_run, progress, results, smoothing
    from postproc import result as estimation

Command = Callable[..., int | None]
_Paths = TypeVar("_Paths", Path, tuple[Path, ...])

_HDF5_READER = "logger.core.runfile.hdf5"
_FARTHEST_M = 30_000
"""Nothing farther is searched."""


def _start_reader(ctx: click.Context, _: click.Parameter, value: _Paths) -> _Paths:
    """It imports while the command does."""
    paths = (value,) if isinstance(value, Path) else value
    if not ctx.resilient_parsing and any(path.suffix == ".h5" for path in paths):
        isolation.start_ahead(_HDF5_READER)
    return value


def _without_results(
    ctx: click.Context, param: click.Parameter, value: tuple[Path, ...]
) -> tuple[Path, ...]:
    # a pattern such as run-*.h5 names what `smooth` wrote beside the runs, too
    runs = tuple(path for path in value if not path.name.endswith(runfile.RESULTS))
    if runs and len(runs) < len(value) and not ctx.resilient_parsing:
        others = ", ".join(path.name for path in value if path not in runs)
        print(f"left out, as results are no runs: {others}", file=sys.stderr)
    return _start_reader(ctx, param, runs or value)


run_argument = click.argument("path", type=INPUT, metavar="RUN", callback=_start_reader)
runs_argument = click.argument(
    "paths", type=INPUT, nargs=-1, required=True, metavar="RUN...", callback=_without_results
)
cells_option = click.option(
    "--cell", "cells", multiple=True, metavar="NAME", help="Only this cell (repeatable)."
)
basemap_option = click.option(
    "--basemap",
    type=INPUT,
    metavar="FILE",
    help="Ground: PMTiles or MBTiles.",
)
streets_option = click.option(
    "--streets",
    type=INPUT,
    metavar="FILE",
    help="Streets to walk: lines of GeoJSON or GPX.",
)
false_alarm_option = click.option(
    "--pfa",
    "p_fa",
    type=number(float, 0, 0.5, open_below=True),
    default=0.05,
    show_default=True,
    metavar="P",
    help="False-alarm rate.",
)


def claims_options(command: Command) -> Command:
    """Add `--claim` and `--claims` of a command that tests claims beside its main work."""
    command = click.option(
        "--claims",
        type=INPUT,
        metavar="FILE",
        help="CSV, cell export or cells.db, as for verify.",
    )(command)
    return click.option(
        "--claim",
        multiple=True,
        metavar="LAT,LON[,SIGMA_M]",
        help="Claimed position of --cell or of every cell (repeatable).",
    )(command)


def prior_options(command: Command) -> Command:
    """Add the options of the propagation prior and pass the `Prior` itself as `prior`."""

    @click.option(
        "--environment",
        default="any",
        show_default=True,
        metavar="NAME",
        help="Path loss: any, open, suburban, urban.",
    )
    @click.option(
        "--antenna",
        default="any",
        show_default=True,
        metavar="NAME",
        help="Any, omni, or sector of unknown azimuth.",
    )
    @click.option(
        "--reach",
        default="any",
        show_default=True,
        metavar="NAME",
        help="Distance from the walk: any, near, or far like masts.",
    )
    @click.option(
        "--height",
        "height_m",
        type=_height_m,
        default="any",
        show_default=True,
        metavar="M",
        help="Metres above the receiver; any weighs several.",
    )
    @functools.wraps(command)
    def with_prior(
        *arguments: Any,
        environment: str,
        antenna: str,
        reach: str,
        height_m: float | None,
        **options: Any,
    ) -> int | None:
        prior = priors.prior_for(environment, height_m=height_m, antenna=antenna, reach=reach)
        return command(*arguments, prior=prior, **options)

    return with_prior


def _height_m(text: str) -> float | None:
    """Metres, or None for any height."""
    metres = number(float, 0, priors.HIGHEST_M, unit="m, or any")
    return None if text == "any" else metres(text)


def area_options(command: Command) -> Command:
    """Add `--within-walk` and `--area`, and pass them in `prior`, with other options or without."""

    @click.option(
        "--within-walk",
        "within_walk_m",
        type=number(float, 1, _FARTHEST_M, unit="m"),
        metavar="M",
        help="It stands within M metres of the walk.",
    )
    @click.option("--area", type=INPUT, metavar="FILE", help="It stands in polygons of GeoJSON.")
    @functools.wraps(command)
    def with_area(
        *arguments: Any,
        within_walk_m: float | None,
        area: Path | None,
        prior: priors.Prior | None = None,
        **options: Any,
    ) -> int | None:
        only_one({"--within-walk": within_walk_m, "--area": area})
        found = area_file.area_of(within_walk_m, area)
        prior = dataclasses.replace(prior or priors.Prior(), area=found)
        return command(*arguments, prior=prior, **options)

    return with_area


def within_option(command: Command) -> Command:
    """Add `--within`, the radius that holds 95 % where a cell is located, as `within_m`."""

    @click.option(
        "--within",
        "radius_m",
        type=number(float, 1, _FARTHEST_M, unit="m"),
        metavar="M",
        help="Radius that holds 95 % where located (default: 150 m).",
    )
    @functools.wraps(command)
    def with_radius(*arguments: Any, radius_m: float | None, **options: Any) -> int | None:
        return command(*arguments, within_m=radius_m or verdict.DESK_M, **options)

    return with_radius


class ListCommand(click.Command):
    """A command without positional arguments, whose repeatable options take several values each.

    It accepts `--sigma 1 2` as well as `--sigma 1 --sigma 2`.
    """

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        repeatable = {
            name
            for parameter in self.params
            if isinstance(parameter, click.Option) and parameter.multiple
            for name in parameter.opts
        }
        current, expanded = "", list[str]()
        for word in args:
            if word.startswith("--"):
                current = word if word in repeatable else ""
            elif current and expanded[-1] != current:
                expanded.append(current)
            expanded.append(word)
        return super().parse_args(ctx, expanded)


def only_one(options: Mapping[str, object], *, is_required: bool = False) -> None:
    """Refuse more than one of several options, by name, and none where one is required."""
    present = [name for name, value in options.items() if value is not None and value is not False]
    context = click.get_current_context()
    if len(present) > 1:
        context.fail(f"{present[1]} is not allowed with {present[0]}")
    if is_required and not present:
        context.fail(f"one of {', '.join(options)} is required")


def read_streets(path: Path | None) -> street_file.StreetLines | tuple[()]:
    """Lines of `--streets`."""
    return () if path is None else street_file.read_lines(path)


def grouped_runs(
    paths: Sequence[Path], cells: Sequence[str] = (), where: area.Area | None = None
) -> list[ground.Group]:
    """The runs of some files by place, each group asked for those of the `cells` that it names.

    Groups far from the area are left out, with a line on stderr, but for the last.
    """
    reading, names = map(runfile.read_sound_run, paths), [path.name for path in paths]
    read = progress.with_progress(reading, "reading", len(paths), names)
    runs = multi_run.named_apart(list(read))
    groups = ground.by_place(runs)
    if where is not None and len(groups) > 1:
        is_kept = [ground.is_near(group, where) for group in groups]
        is_kept[-1] |= not any(is_kept)  # its estimate says what is wrong
        for group, kept in zip(groups, is_kept, strict=True):
            if not kept:
                print(f"{group.title} is not near the area {where.text}: left out", file=sys.stderr)
        groups = list(itertools.compress(groups, is_kept))
    return list(ground.groups_with(groups, cells))


def estimate(
    runs: Sequence[runfile.Run], cells: Sequence[str], options: estimation.Options | None = None
) -> estimation.Result:
    """Estimate cells (none named: all) on all processors."""
    return smoothing.smooth_runs(
        runs,
        cells,
        options=options or estimation.Options(),
        progress=progress.with_progress,
        processes=processors(),
    )


def stored_or_estimated(
    runs: Sequence[runfile.Run], cells: Sequence[str], options: estimation.Options | None = None
) -> estimation.Result:
    """The result that `smooth` has stored beside the (first) run, or a new one."""
    return stored_result(runs, cells, options) or estimate(runs, cells, options)


def stored_result(
    runs: Sequence[runfile.Run], cells: Sequence[str], options: estimation.Options | None = None
) -> estimation.Result | None:
    """What `smooth` has stored beside the (first) run; a line on stderr where it is not used."""
    path = results.path_beside([run.path for run in runs])
    try:
        result = results.read(path, runs, cells, options or estimation.Options())
    except results.NotStored as reason:
        if str(reason):
            print(f"{path} is not used: {reason}", file=sys.stderr)
        return None
    print(f"estimates are those of {path}", file=sys.stderr)
    return result


def processors() -> int:
    """Number of processors that the estimators may use."""
    return os.cpu_count() or 1


def start_of(text: str) -> places.Places:
    """Where `--from` says that a walk begins; raises as `position_of`."""
    at, _ = places.position_of(text)
    return places.Places.of_degrees(at.lat, at.lon)
