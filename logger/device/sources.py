"""All kinds of sources, by their settings."""

from collections.abc import Mapping
from typing import Any

from logger.config import GpsdSettings, ModemSettings, NmeaSettings, SourceSettings
from logger.device.gnss_source import GpsdSource, NmeaSource
from logger.device.link import Source
from logger.device.modem_source import ModemSource

SOURCES: Mapping[type[SourceSettings], type[Source[Any]]] = {
    NmeaSettings: NmeaSource,
    ModemSettings: ModemSource,
    GpsdSettings: GpsdSource,
}
"""In the order in which a port is probed: what only listens before what writes."""


def source_of(settings: SourceSettings) -> Source[Any]:
    """The source with these settings."""
    return SOURCES[type(settings)](settings)
