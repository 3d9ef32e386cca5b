"""The driver of every modem that no other driver claims."""

from logger.drivers.generic.generic import Generic

DRIVERS = (Generic,)
