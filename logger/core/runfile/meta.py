"""What a run says about itself: the first frame of a journal, repeated every minute, and `/meta` of the HDF5 file."""

import msgspec

from logger.core.live_settings import LiveSettings
from logger.core.schema import SCHEMA_VERSION, columns_of


class Truth(msgspec.Struct, frozen=True):
    """Place of a transmitter of a simulated run."""

    cell: str
    lat_deg: float
    lon_deg: float


class RunMeta(msgspec.Struct, frozen=True, kw_only=True):
    """Identity and circumstances of a run; `columns` lets a reader of any version find its way in the rows."""

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
    columns: dict[str, list[tuple[str, str]]] = msgspec.field(default_factory=lambda: columns_of(SCHEMA_VERSION))


class RunEnd(msgspec.Struct, frozen=True, kw_only=True):
    """How a run stopped: written last, so that its absence says that the plug was pulled.

    `digest` is that of the hash chain over all frames before this one.
    """

    t_ns: int
    reason: str
    n_records: int
    digest: str = ""


class Damage(msgspec.Struct, frozen=True, kw_only=True):
    """What is known to be missing from a journal."""

    missing_frames: int = 0
    skipped_bytes: int = 0
    description_lost: bool = False

    def __bool__(self) -> bool:
        return bool(self.missing_frames or self.skipped_bytes or self.description_lost)

    def __str__(self) -> str:
        told = f"{self.missing_frames} frames missing, {self.skipped_bytes} bytes damaged"
        return told + ", the description of the run lost" if self.description_lost else told
