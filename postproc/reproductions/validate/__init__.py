"""The specification, checked: each item of its checklist as an executed check with its figure.

    check        claim, what we measured, verdict
    utm          places on the map
    model        initial state, expected level, Jacobian, and the sign in the derivation
    update       gain, state and covariance after one reading
    convergence  the table on the circle of 500 m, beside our locator and the Cramer-Rao bound
    scenarios    five walks through the live estimate
    cost         memory and time
    bound, walk  what they need
    suite        all of them in order
    report       table, JSON and Markdown

The claims are those of "EKF Implementation Validation" and "Mathematical Derivations" of
github.com/shinnosuke1023/cell-finder (android/ekf_validation.md, MATHEMATICAL_DERIVATIONS.md).
"""
