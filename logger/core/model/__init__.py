"""The measurement model: how strong a transmitter is received, and how that is disturbed.

The level z_k of block k of the walk, received from a transmitter at (x, y):

    z = P0 - eta L(x, y) + offsets of modems + antenna pattern + v,    v ~ N(0, sigma^2 K)

`path_loss`, the only module with log10 of a distance, has L, `prior` what is assumed before the
walk. `blocks` gathers the readings, `columns` multiply P0, eta and the harmonics of the antenna
pattern, `noise` is K. `marginal` makes the `evidence` of positions, with `elimination`.

Every estimator uses this package, live and offline; it imports none of them.
"""
