"""A world to walk in: base stations, a walker, and a modem and a receiver that tell of them through
real ptys.

- `east_m, north_m` are local: metres from the origin of the world, north at the origin being true north.
- `t_s` is seconds since the walk began; the walker stands still before and after.
- Everything random comes from a numpy Generator that is passed in, so that a seed is a whole walk.
"""
