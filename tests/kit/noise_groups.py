"""Small sets of noise hypotheses for tests whose oracle goes through all of them."""

from logger.core.model.prior import WHITE, Hypothesis, NoiseGroup


def noise_groups(*correlated: Hypothesis, trust: float = 1.0) -> tuple[NoiseGroup, ...]:
    """White noise alone, and a group of correlated hypotheses with this trust, if there are any."""
    white = NoiseGroup(1.0, (WHITE,))
    return (white, NoiseGroup(trust, correlated)) if correlated else (white,)
