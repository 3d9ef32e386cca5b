"""How many digits the network code of a country has (ITU-T E.212 and its list of networks)."""

_THREE = frozenset({"302", *map(str, range(310, 317))})  # Canada, USA
_EITHER = frozenset({"001", "405", "502", "706", "708", "714", "722", "732", "750", "999"})
"""Tests, India, Malaysia, El Salvador, Honduras, Panama, Argentina, Colombia, Falkland Islands,
private networks.
"""


def mnc_digits(mcc: str) -> int | None:
    """Two or three; None where both are in use, as on many islands of zone 3."""
    if mcc in _THREE:
        return 3
    return None if mcc in _EITHER or mcc.startswith("3") else 2
