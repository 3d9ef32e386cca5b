"""Where a transmitter stands: the posterior over positions, with all other unknowns integrated out.

The model of the levels is `logger.core.model`. Given a position, a hypothesis of the noise and
sigma, it is linear in P0 and eta, which are integrated in closed form. Sigma is integrated by
quadrature. Positions and hypotheses are summed, the positions over a quadtree of squares that are
split where probability is (marginalised point mass; Schoen, Gustafsson & Nordlund, IEEE Trans.
Signal Process. 53(7), 2005). `pipeline` names the steps in their order; begin to read there.

    pipeline          the five steps
    preparation       readings of a cell -> what is searched
    search            steps 1 to 3: coarse, weigh the noise, refine
    quadtree          squares and their prior
    tree_growth       which squares are split
    position_evidence the evidence of a walk at squares
    evidence          blocks, positions -> log evidence of each hypothesis, with P0 and eta
    tobit             what censored readings add
    joint_evidence    which noise explains levels and censored readings
    orthant           the probability that all correlated levels are beyond a limit
    mixture           evidence -> probability of positions
    symmetry          tracks that are straight or round to within their errors
    timing_advance    what timing advances add
    offsets           how much higher one modem reads than another
    observables       what the levels show without a model, pooled with the posterior
    summary           step 4: tree -> posterior
    posterior         the result
    region            highest-density regions and modes
    verdict           step 5
    two_source_test   whether two transmitters share the identity
    online            the same reading by reading, for the device
"""
