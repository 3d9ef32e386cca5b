"""What a user types to name a cell or a position."""

from logger.core.errors import ConfigError

_USUAL_M = 1000.0


def identity_of(name: str) -> tuple[int, int, int, int] | None:
    """MCC, MNC, area and cell of a name, None where it is no identity."""
    parts = name.split("-")
    if len(parts) != 4 or not all(
        part.isascii() and part.isdigit() and len(part) < 12 for part in parts
    ):
        return None
    mcc, net, area, cell = map(int, parts)
    return mcc, net, area, cell


def place_of(text: str) -> tuple[float, float, float]:
    """LAT,LON[,RADIUS_M]; raises `ConfigError`."""
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) not in {2, 3}:
        raise ConfigError(f"{text!r} is no position: LAT,LON or LAT,LON,RADIUS_M is wanted")
    return values[0], values[1], values[2] if len(values) == 3 else _USUAL_M
