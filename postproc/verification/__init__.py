"""Whether a cell is where it claims to be.

    theory    ranges against a claimed position: direct and indirect test, in closed form and simulated
    ranging   what a level says of a distance, and whether errors are normal
    report    the printed table of the report beside what the theory gives
    asked     what a user types to name a cell or a place
    cellfile  exports of OpenCelliD and Mozilla Location Service, read by columns
    celldb    millions of their cells in one indexed file
    claims    claimed positions, from the command line, a CSV or such a file
    noise     covariance of the levels, shadowing averaged over the readings of a block
    field     what a walk, real or simulated, says about many places at once
    direct    residuals of a walk at the claimed position
    indirect  the claim in the posterior of the walk
    drawn     walks as they would be if the claim were true, which calibrate both tests
    power     what a walk could have told
    sites     whether one identity is heard from one place or from two
    walk      both tests of a cell with their power, verdict and recommendation
    run       every claimed cell of a run, false discoveries controlled
    tables    all of it in a terminal

Theory: T. Naganawa, KAKENHI 20K14743, on unifying position verification and position estimation;
restated in our own terms in `theory`. On a walk the receiver moves, shadowing is correlated, and
power and exponent are unknown.
"""
