"""Drivers of SIMCom modems."""
