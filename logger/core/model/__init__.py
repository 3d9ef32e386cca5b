"""The measurement model: how strong a transmitter is received, and how that is disturbed.

The level z_k of block k of the walk, received from a transmitter at (x, y):

    z = P0 - eta L(x, y) + offsets of modems + antenna pattern + v,    v ~ N(0, sigma^2 K)

    path_loss    L, its slope and the receiver's error: the only module with log10 of a distance
    prior        what is assumed before the walk; the hypotheses of the noise with their trust
    blocks       readings -> blocks of readings taken at one point
    columns      the columns that multiply P0, eta and the harmonics of the antenna pattern
    noise        K of the blocks for each hypothesis, and the matrices that whiten it
    elimination  many small symmetric systems at once
    evidence     what the levels give at each position, under each hypothesis
    marginal     evidence of positions, the coefficients and sigma integrated out

Every estimator uses this package, live and offline; it imports none of them.
"""
