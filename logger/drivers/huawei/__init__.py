"""Drivers of Huawei modems."""

from logger.drivers.huawei.huawei import Huawei

DRIVERS = (Huawei,)
