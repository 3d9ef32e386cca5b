"""Levels that are printed as an index of 3GPP, and the value of each index."""

from dataclasses import dataclass

from logger.drivers.reading.fields import decimal


@dataclass(frozen=True, slots=True)
class Scale:
    """Indices from `lowest` to `highest`; index 0 stands for `at_zero`, in dBm or dB."""

    highest: int
    at_zero: float
    step: float = 1.0
    lowest: int = 0

    def value_of(self, text: str) -> float | None:
        """The level of a printed index; None for one outside the scale, which is unknown."""
        return self.value_at(decimal(text, self.lowest, self.highest))

    def value_at(self, index: int | None) -> float | None:
        """The level of an index."""
        if index is None or not self.lowest <= index <= self.highest:
            return None
        return self.at_zero + self.step * index


# 3GPP TS 27.007 8.69 (+CESQ), which refers to 45.008 8.1.4, 25.133 9.1 and 36.133 9.1
RXLEV_OF_INDEX = Scale(63, -110.0)
RSCP_OF_INDEX = Scale(96, -121.0)
ECN0_OF_INDEX = Scale(49, -24.5, 0.5)
RSRP_OF_INDEX = Scale(97, -141.0)
RSRQ_OF_INDEX = Scale(34, -20.0, 0.5)
# 38.133 10.1.6 and 10.1.11
SS_RSRP_OF_INDEX = Scale(126, -157.0)
SS_RSRQ_OF_INDEX = Scale(126, -43.5, 0.5)
CSQ_OF_INDEX = Scale(31, -113.0, 2.0)
"""27.007 8.5 (+CSQ)."""
CARRIER_OF_INDEX = Scale(76, -100.0)
"""Level of a WCDMA carrier, all its cells together (25.133 9.1.3)."""
