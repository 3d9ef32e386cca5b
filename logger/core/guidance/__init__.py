"""Where to walk next: the way whose readings are expected to say most about the position.

The modules build on each other: `sample`, `forecast`, `routes`, `planner`, `advice`, and
`followed_cell`, which adds the answer about the cell.

The information follows Kolchinsky & Tracey, Entropy 19(7), 2017. Positions are in UTM metres.
Nothing here draws a random number, so a replay gives the same advice to the last bit.
"""
