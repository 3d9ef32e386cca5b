"""Whether a cell is where it claims to be.

Theory: T. Naganawa, KAKENHI 20K14743, on unifying position verification and position estimation;
`postproc.reproductions.theory` restates it. On a walk the receiver moves, shadowing is correlated,
and power and exponent are unknown.
"""
