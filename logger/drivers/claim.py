"""Which modems a driver serves: what it claims of their answers to ATI, AT+CGMI and AT+CGMM."""

import re
from dataclasses import dataclass

_FLAGS = re.IGNORECASE | re.DOTALL


@dataclass(frozen=True, slots=True)
class Claim:
    """Regular expressions searched in a modem's identity; an empty one claims nothing.

    The most specific claim wins, whatever the order of the drivers: `model` (one model by its
    name) before `series` (a group of models) before `maker`. Two claims of one rank on one answer
    are a mistake, which a test reports.
    """

    model: str = ""
    series: str = ""
    maker: str = ""

    def rank(self, identity: str) -> int:
        """How specific the claim on a modem is: 3 its model, 2 its series, 1 its maker, 0 none."""
        ascending = enumerate((self.maker, self.series, self.model), 1)
        ranks = [rank for rank, form in ascending if form and re.search(form, identity, _FLAGS)]
        return max(ranks, default=0)
