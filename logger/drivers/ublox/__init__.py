"""Drivers of u-blox modems."""

from logger.drivers.ublox.ublox import Ublox

DRIVERS = (Ublox,)
