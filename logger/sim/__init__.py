"""A simulated world: base stations, a walker, a modem and a receiver behind real ptys.

- `east_m, north_m` are local: metres from the origin of the world, with true north at the origin.
- `t_s` is seconds since the walk began; the walker stands still before and after.
- Everything random comes from a numpy Generator argument, so that a seed determines a walk.
"""
