"""Where a transmitter stands: the posterior over places, with everything else integrated out.

Model of the mean level z_k in block k of the walk, L_k = 10 log10 d_k:

    z = P0 - eta L(x, y) + v,    v ~ N(0, sigma^2 K),    K_ij = (1 - a) <exp(-D / d_c)> + a delta_ij / n_i

with <> the mean over the points of blocks i and j, D apart (shadowing is a property of the place:
Gudmundson, Electron. Lett. 27(23), 1991), a the white share and n_i the readings of the block. A
hypothesis of the noise is a pair (a, d_c). Given (x, y), the hypothesis and sigma the model is
linear in P0 and eta, which are integrated in closed form; sigma is integrated by quadrature; places
and hypotheses are summed, the places over a tree of square cells split where the mass is
(marginalised point mass; Schoen, Gustafsson & Nordlund, IEEE Trans. Signal Process. 53(7), 2005).

    prior      what is believed before the walk
    symmetry   a track that is straight or round but for its errors
    blocks     readings -> blocks of one place
    covariance K of each hypothesis of the noise, and what whitens it
    evidence   blocks, places -> log evidence of each hypothesis, with P0 and eta
    offsets    how much higher one modem reads than another
    censored   what readings at the end of the modem's scale add to it
    joint      which noise explains levels and censored readings together
    orthant    how likely correlated levels are all beyond a limit
    mixture    evidence -> probability of places
    timing     what timing advances say of places
    tree       the search over places
    region     highest-density sets and separate places
    posterior  all of it for the readings of a cell
    division   whether two transmitters share the identity
    online     the same, reading by reading
    verdict    located, ambiguous or cannot tell, in plain words
"""
