"""Drivers of Fibocom modems."""

from logger.drivers.fibocom.fibocom import Fibocom

DRIVERS = (Fibocom,)
