"""Baselines: what many walks heard, by square of 300 m, in one SQLite file."""
