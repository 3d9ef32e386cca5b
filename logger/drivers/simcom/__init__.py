"""Drivers of SIMCom modems."""

from logger.drivers.simcom.sim800 import Sim800
from logger.drivers.simcom.sim7000 import Sim7000
from logger.drivers.simcom.sim7600 import Sim7600

DRIVERS = (
    Sim800,
    Sim7000,
    Sim7600,
)
