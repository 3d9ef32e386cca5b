"""Metadata of a run: the first frame of a journal, repeated every minute, and HDF5 `/meta`.

The origin says whether it is recorded, simulated, imported, or a shared copy of such a run.
"""

import msgspec

from logger.core.live_settings import LiveSettings
from logger.core.schema import MOST_NS, SCHEMA_VERSION, columns_of


class Truth(msgspec.Struct, frozen=True):
    """Position of a transmitter of a simulated run."""

    cell: str
    lat_deg: float
    lon_deg: float


class RunMeta(msgspec.Struct, frozen=True, kw_only=True):
    """Identity and circumstances of a run.

    `columns` lets a reader of any version interpret the rows.
    """

    run_id: str
    boot_id: str
    started_ns: int
    origin: str
    program: str
    versions: dict[str, str] = {}
    config_text: str = ""
    live: LiveSettings = LiveSettings()
    truth: tuple[Truth, ...] = ()
    schema: int = SCHEMA_VERSION
    columns: dict[str, list[tuple[str, str]]] = msgspec.field(
        default_factory=lambda: columns_of(SCHEMA_VERSION)
    )


def check_meta(meta: RunMeta) -> None:
    """Raise ValueError for values of the right type that are impossible."""
    if any("\0" in text for text in (meta.run_id, meta.boot_id, meta.origin, meta.program)):
        raise ValueError("it holds a NUL character")
    if not -MOST_NS < meta.started_ns < MOST_NS:
        raise ValueError("the start is no time")
    if not all(abs(truth.lat_deg) <= 90.0 and abs(truth.lon_deg) <= 180.0 for truth in meta.truth):
        raise ValueError("the position of a transmitter is not on the Earth")


class RunEnd(msgspec.Struct, frozen=True, kw_only=True):
    """How a run stopped: written last, so its absence means that the power failed.

    `digest` is that of the hash chain over all frames before this one.
    """

    t_ns: int
    reason: str
    n_records: int
    digest: str = ""


def stop_text(end: RunEnd) -> bytes:
    """Payload of the frame before an END, which repeats it: the stop is under the hash chain."""
    stop = msgspec.structs.asdict(end)
    del stop["digest"]
    return msgspec.json.encode(stop)


def check_end(end: RunEnd) -> None:
    """As `check_meta`."""
    if not -MOST_NS < end.t_ns < MOST_NS:
        raise ValueError("the end is no time")


class Damage(msgspec.Struct, frozen=True, kw_only=True):
    """What is known to be missing from a run.

    `meaningless_values` are those that no recorder writes; a reader counts them, and takes them for
    unknown.
    """

    missing_frames: int = 0
    skipped_bytes: int = 0
    description_lost: bool = False
    meaningless_values: int = 0

    def __bool__(self) -> bool:
        return bool(
            self.missing_frames
            or self.skipped_bytes
            or self.description_lost
            or self.meaningless_values
        )

    def __str__(self) -> str:
        text = f"{self.missing_frames} frames missing, {self.skipped_bytes} bytes damaged"
        text += ", the description of the run lost" if self.description_lost else ""
        return text + (
            f", {self.meaningless_values} values without a meaning"
            if self.meaningless_values
            else ""
        )


# --- origins ---

IMPORT = "import of"
IMPORT_WITHOUT_TIMES = "import without times of"
DATED = ", with dates"
"""Ends an import of dated times of no known zone."""
SHARED = "shared copy"
SIMULATED = "simulated walk "
"""The name of the scenario follows."""

_IMPORTS = (IMPORT, IMPORT_WITHOUT_TIMES, f"{SHARED} of an import")
_WITHOUT_TIMES = (IMPORT_WITHOUT_TIMES, f"{SHARED} of an import without times")


def is_import(origin: str) -> bool:
    """Whether another program recorded it: its times are then those of that program."""
    return origin.startswith(_IMPORTS)


def has_times(origin: str) -> bool:
    """Whether times of a run are more than the order of its records."""
    return not origin.startswith(_WITHOUT_TIMES)


def is_dated(origin: str) -> bool:
    """Whether an import had dates, although no fix has UTC."""
    return is_import(origin) and origin.endswith(DATED)


def is_simulated(origin: str) -> bool:
    """Whether the simulator recorded it, perhaps faster than real: its receiver is never wrong."""
    return origin.startswith(SIMULATED)


def may_be_copy(origin: str) -> bool:
    """Whether it is shared, or imported."""
    return origin.startswith(SHARED) or is_import(origin)


def origin_of_copy(origin: str) -> str:
    """Origin of a copy to give away, which names no file of its owner."""
    if not is_import(origin):
        return SHARED
    return (
        f"{SHARED} of an import{'' if has_times(origin) else ' without times'}"
        f"{DATED if is_dated(origin) else ''}"
    )
