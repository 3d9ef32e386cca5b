"""Numbers of people and of their devices, blanked before anybody sees them.

Nothing here asks for IMSI, IMEI, SIM or telephone numbers, but modems volunteer them (ATI of a SIM5360 prints the
IMEI). IMEI and IMSI have 15 digits, IMEISV 16 (3GPP TS 23.003), a SIM 18 to 22 (ITU-T E.118); nothing that tells of a
cell, a place or a time has more than 14 in a row.
"""

import re

_PERSONAL = re.compile(rb"[0-9]{15,}|[0-9]{2}-[0-9]{6}-[0-9]{6}-[0-9]{1,2}|\+[0-9]{8,}")
_UNDER_WAY = re.compile(rb"[+0-9][0-9-]{0,63}\Z")
_DIGIT = re.compile(rb"[0-9]")


class Blanker:
    """Bytes of a modem in, the same with an x for each digit of a personal number out, however they are cut.

    A number under way is held back until the byte after it has come.
    """

    def __init__(self) -> None:
        self._held = b""

    def feed(self, data: bytes) -> bytes:
        data = self._held + data
        under_way = _UNDER_WAY.search(data)
        end = under_way.start() if under_way else len(data)
        self._held = data[end:]
        return blanked(data[:end])

    def flush(self) -> bytes:
        """What is held back, at the end of a connection."""
        held, self._held = self._held, b""
        return blanked(held)


def blanked(data: bytes) -> bytes:
    """The same bytes with an x for each digit of a personal number."""
    return _PERSONAL.sub(lambda number: _DIGIT.sub(b"x", number[0]), data)
