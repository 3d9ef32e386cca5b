"""A run in the format of another program.

The file does not identify the walker or the hardware: no configuration, names or notes.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from logger.core.errors import ConfigError, RunFileError
from postproc.atomic_write import whole_file
from postproc.interop import geojson, gpx, kml, opencellid, walk_csv, wigle
from postproc.interop.estimates import Estimate
from postproc.interop.levels import ExportWalk
from postproc.interop.sighting import Sighting


@dataclass(frozen=True, slots=True)
class Format:
    """A format: its writer, whether it has estimates, and which levels it can represent."""

    write: Callable[[ExportWalk, Sequence[Estimate], Path], None]
    has_estimates: bool = False
    writable: Callable[[Sighting], bool] | None = None


@dataclass(frozen=True, slots=True)
class Exported:
    """What an export did; `left_out` lists what the file does not contain."""

    path: Path
    format: str
    n_levels: int
    n_fixes: int
    n_estimates: int
    has_utc: bool
    left_out: tuple[str, ...]


def _parquet(walk: ExportWalk, _: Sequence[Estimate], target: Path) -> None:
    from postproc.interop import parquet  # noqa: PLC0415 (pyarrow comes with rerun, or is missing)

    parquet.write(walk.sightings, target, walk.start_ns)


FORMATS = {
    "kml": Format(kml.write, has_estimates=True),
    "geojson": Format(geojson.write, has_estimates=True),
    "gpx": Format(gpx.write, has_estimates=True),
    "csv": Format(lambda walk, _, target: walk_csv.write(walk.sightings, target, walk.start_ns)),
    "wigle": Format(
        lambda walk, _, target: wigle.write(walk.sightings, target), writable=wigle.writable
    ),
    "opencellid-csv": Format(
        lambda walk, _, target: opencellid.write_csv(walk.sightings, target),
        writable=opencellid.writable,
    ),
    "opencellid-json": Format(
        lambda walk, _, target: opencellid.write_json(walk.sightings, target),
        writable=opencellid.writable,
    ),
    "parquet": Format(_parquet),
}
_BY_SUFFIX = {f".{name}": name for name in ("kml", "geojson", "gpx", "csv", "parquet")}


def format_of(name: str | None, target: Path, *, with_estimates: bool = False) -> str:
    """Name of the format, by default that of the suffix.

    Raises `ConfigError` for an unknown one, and for one without estimates if those are wanted.
    """
    if name is None:
        name = _BY_SUFFIX.get(target.suffix.lower())
    if name is None:
        suffixes = ", ".join(_BY_SUFFIX)
        raise ConfigError(
            f"{target}: name a format with --format ({', '.join(FORMATS)}), or end in {suffixes}"
        )
    if name not in FORMATS:
        raise ConfigError(f"format {name!r} is unknown: one of {', '.join(FORMATS)}")
    if with_estimates and not FORMATS[name].has_estimates:
        raise ConfigError(
            f"{name} contains measurements only; kml, geojson and gpx can contain estimates"
        )
    return name


def write_export(
    walk: ExportWalk, estimates: Sequence[Estimate], target: Path, name: str
) -> Exported:
    """Write a file, complete or not at all.

    Raises `RunFileError` where the format can represent none of the levels.
    """
    form = FORMATS[name]
    sightings = [s for s in walk.sightings if form.writable is None or form.writable(s)]
    if form.writable is not None and not sightings:
        why = "" if walk.has_utc else ": the format needs UTC, and the receiver never reported it"
        raise RunFileError(f"nothing in the run can be written as {name}{why}")
    writable = ExportWalk(tuple(sightings), walk.track, walk.utm, walk.start_ns, walk.has_utc, 0, 0)
    with whole_file(target) as part:
        form.write(writable, estimates, part)
    left_out = (
        *_left_out(walk, len(sightings)),
        *(why for estimate in estimates for why in estimate.left_out),
    )
    return Exported(
        target,
        name,
        len(sightings),
        sum(map(len, walk.track)),
        len(estimates) if form.has_estimates else 0,
        walk.has_utc,
        left_out,
    )


def _left_out(walk: ExportWalk, n_written: int) -> tuple[str, ...]:
    counts = {
        "without a complete identity, which the format needs": len(walk.sightings) - n_written,
        "of cells without an identity": walk.n_without_identity,
        "without a fix near in time": walk.n_without_position,
    }
    omissions = [f"{n} readings {what}" for what, n in counts.items() if n]
    return (
        *omissions,
        *([] if walk.has_utc else ["times in UTC: the receiver never reported them"]),
    )
