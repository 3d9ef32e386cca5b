"""Where a transmitter stands: the posterior over positions, with all other unknowns integrated out.

The model of the levels is `logger.core.model`. Given a position, a hypothesis of the noise and
sigma, it is linear in P0 and eta, which are integrated in closed form. Sigma is integrated by
quadrature. Positions and hypotheses are summed, the positions over a quadtree of squares that are
split where probability is (marginalised point mass; Schoen, Gustafsson & Nordlund, IEEE Trans.
Signal Process. 53(7), 2005).

Begin to read in `pipeline`, which names the steps in their order. `preparation` makes their input,
`search` is steps 1 to 3 (with `quadtree`, `tree_growth`, `position_evidence` and `mixture`),
`summary` step 4, which makes a `posterior`, and `verdict` step 5. `tobit`, `joint_evidence` and
`orthant` are for censored readings. `online` is the same reading by reading, for the device.
"""
