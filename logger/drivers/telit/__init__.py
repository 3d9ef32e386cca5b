"""Drivers of Telit modems."""

from logger.drivers.telit.telit import Telit

DRIVERS = (Telit,)
