"""A run in the format of another program.

The file does not identify the walker or the hardware: no configuration, names or notes.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from types import ModuleType

from logger.core.errors import ConfigError, RunFileError
from postproc.atomic_write import whole_file
from postproc.interop import writers
from postproc.interop.estimates import Estimate
from postproc.interop.levels import ExportWalk


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


def writer(name: str) -> ModuleType:
    """The module of a format."""
    return import_module(f"{writers.__name__}.{name.replace('-', '_')}")


def has_estimates(name: str) -> bool:
    """Whether a format has a place for positions of cells."""
    return bool(getattr(writer(name), "HAS_ESTIMATES", False))


def formats_with_estimates() -> list[str]:
    found = []
    for name in writers.names():
        with suppress(ModuleNotFoundError):  # parquet: pyarrow comes with rerun, or is missing
            if has_estimates(name):
                found.append(name)
    return found


def format_of(name: str | None, target: Path, *, with_estimates: bool = False) -> str:
    """Name of the format, by default that of the suffix.

    Raises `ConfigError` for an unknown one, and for one without estimates if those are wanted.
    """
    known = writers.names()
    if name is None:
        name = target.suffix[1:].lower()
        if name not in known:
            raise ConfigError(
                f"{target}: name a format with --format ({', '.join(known)}), or end in one of them"
            )
    if name not in known:
        raise ConfigError(f"format {name!r} is unknown: one of {', '.join(known)}")
    if with_estimates and not has_estimates(name):
        able = ", ".join(formats_with_estimates())
        raise ConfigError(f"{name} contains measurements only; {able} can contain estimates")
    return name


def write_export(
    walk: ExportWalk, estimates: Sequence[Estimate], target: Path, name: str
) -> Exported:
    """Write a file, complete or not at all.

    Raises `RunFileError` where the format can represent none of the levels.
    """
    form = writer(name)
    writable = getattr(form, "writable", None)
    sightings = [s for s in walk.sightings if writable is None or writable(s)]
    if writable is not None and not sightings:
        why = "" if walk.has_utc else ": the format needs UTC, and the receiver never reported it"
        raise RunFileError(f"nothing in the run can be written as {name}{why}")
    written = replace(walk, sightings=tuple(sightings), n_without_identity=0, n_without_position=0)
    with whole_file(target) as part:
        form.write(written, estimates, part)
    left_out = (
        *_left_out(walk, len(sightings)),
        *(why for estimate in estimates for why in estimate.left_out),
    )
    return Exported(
        target,
        name,
        len(sightings),
        sum(map(len, walk.track)),
        len(estimates) if has_estimates(name) else 0,
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
