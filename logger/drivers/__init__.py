"""Drivers: bytes and text of devices in, values out; no I/O, no waiting, no clock."""
