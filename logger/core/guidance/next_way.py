"""The advice as `postproc guide` prints it and `status.json` has it; without numpy."""

import msgspec


class NextWay(msgspec.Struct, frozen=True):
    """Where to walk next: `azimuth_deg` from true north, to `lat, lon` (WGS 84).

    `text` says all of it and the reason, `why` the reason alone.
    """

    azimuth_deg: float
    distance_m: float
    lat: float
    lon: float
    nats_per_km: float
    text: str
    why: str = ""
