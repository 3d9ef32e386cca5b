"""Drivers of Sierra Wireless modems."""
