"""Drivers of Telit modems."""
