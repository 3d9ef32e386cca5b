"""Drivers of Fibocom modems."""
