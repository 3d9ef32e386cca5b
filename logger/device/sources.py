"""All kinds of sources, by their settings."""

from collections.abc import Mapping
from typing import Any

from logger.config import GpsdSettings, ModemSettings, NmeaSettings, SourceSettings
from logger.device.gpsd_source import GpsdSource
from logger.device.link import Source
from logger.device.modem_source import ModemSource
from logger.device.nmea_source import NmeaSource

SOURCES: Mapping[type[SourceSettings], type[Source[Any]]] = {
    NmeaSettings: NmeaSource,
    ModemSettings: ModemSource,
    GpsdSettings: GpsdSource,
}
"""In the order in which a port is probed: what only listens before what writes."""


def source_of(settings: SourceSettings) -> Source[Any]:
    """The source with these settings."""
    return SOURCES[type(settings)](settings)
