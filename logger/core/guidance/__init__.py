"""Where to walk next: the way whose readings are expected to say most about the position.

    sample         positions drawn from the posterior, and places where its probability is gathered
    forecast       levels to expect at points not yet walked, and what they would say, in nats
    routes         ways to consider: eight directions, or the streets of a map
    planner        these by information for each metre
    advice         when to plan, and the advice until the next plan
    followed_cell  this with the answer about the cell, as the walker is shown them

The information follows Kolchinsky & Tracey, Entropy 19(7), 2017. Positions are in UTM metres.
Nothing here draws a random number, so a replay gives the same advice to the last bit.
"""
