"""Guidance at the desktop: a filter for other loggers, and the next walk after recorded ones."""
