"""Drivers of Siemens, Cinterion, Gemalto and Thales modems."""
