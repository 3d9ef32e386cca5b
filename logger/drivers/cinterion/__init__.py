"""Drivers of Siemens, Cinterion, Gemalto and Thales modems."""

from logger.drivers.cinterion.cinterion import Cinterion

DRIVERS = (Cinterion,)
