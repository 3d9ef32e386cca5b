"""Drivers of Quectel modems."""
