"""Drivers of u-blox modems."""
