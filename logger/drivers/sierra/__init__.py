"""Drivers of Sierra Wireless modems."""

from logger.drivers.sierra.sierra import Sierra

DRIVERS = (Sierra,)
