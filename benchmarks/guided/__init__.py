"""Closed loops: a policy walks a simulated world, and its readings decide where it goes next."""
