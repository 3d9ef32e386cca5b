"""What a user types to name a cell or a position."""

from logger.core.errors import ConfigError

_USUAL_M = 1000.0


def place_of(text: str) -> tuple[float, float, float]:
    """LAT,LON[,RADIUS_M]; raises `ConfigError`."""
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) not in {2, 3}:
        raise ConfigError(f"{text!r} is no position: LAT,LON or LAT,LON,RADIUS_M is wanted")
    return values[0], values[1], values[2] if len(values) == 3 else _USUAL_M
