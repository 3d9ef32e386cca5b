"""Drivers of Quectel modems."""

from logger.drivers.quectel.quectel import Quectel
from logger.drivers.quectel.quectel_gsm import QuectelGsm

DRIVERS = (
    Quectel,
    QuectelGsm,
)
