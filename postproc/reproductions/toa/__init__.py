"""Position of a moving object from ranges to anchors: the README of Kalman_Filter_ToA, reproduced.

    model      anchors -> differences of squared ranges z, H, R
    lse        the fix of one epoch by the normal equations, with its covariance
    process    Q and E[w]: those of the README, and in closed form
    kalman     the filter of the README, vectorised over runs
    squares    the same task without a singular matrix: a filter on the squared ranges themselves
    bound      what no unbiased estimator can beat
    simulate   mean errors over many runs
    report     table, JSON, picture

Source: github.com/Yongseok1221/Kalman_Filter_ToA, README.md as of 2025-12-12 (one file; it
publishes no error and no initial P).
"""
