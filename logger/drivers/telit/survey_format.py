"""The format of a Telit survey: the base of its numbers, which the reply does not state.

AT#CSURVF decides whether area and cell are decimal (0, as shipped) or padded hexadecimal with an
octal BSIC. Widths, letters and ranges show it.
"""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from logger.core.types import Broadcast, Rat
from logger.drivers.reading.fields import decimal

DECIMAL, HEXADECIMAL = 10, 16
_BASE_SETTING = re.compile(r"#CSURVF(?:=|:\s*)([0-2])", re.IGNORECASE)
_LEAST_CODES = 2
"""Codes that show a hexadecimal print; a single one may be damaged."""


@dataclass(frozen=True, slots=True)
class Carrier:
    """Texts of one carrier, by label; without an identity only channel and level."""

    rat: Rat
    texts: dict[str, str]
    broadcast: Broadcast | None = None

    @property
    def area(self) -> str:
        """The area code as printed."""
        return self.texts.get("lac", self.texts.get("tac", ""))

    @property
    def bases(self) -> set[int]:
        """The only bases that the widths and digits of area, cell and BSIC allow."""
        cell_width = 4 if self.rat == "GSM" else 8
        bases = {
            _base_of(self.area, 4),
            _base_of(self.texts.get("cellid", ""), cell_width),
            _base_of_bsic(self.texts.get("bsic", "")),
        }
        return {base for base in bases if base is not None}


def _base_of(text: str, width: int) -> int | None:
    """Base of a number that is padded to `width` digits if hexadecimal and unpadded if decimal."""
    if not text or text == "0":
        return None
    if re.search(r"[A-Fa-f]", text) or text.startswith("0"):
        return HEXADECIMAL
    if len(text) == width - 1 and width == 8:
        return None  # seven digits hold all 28 bits, so a firmware may print no more
    # the cell identity has 28 bits, so its eighth hexadecimal digit is 0
    return None if len(text) == width == 4 else DECIMAL


def _base_of_bsic(text: str) -> int | None:
    number = decimal(text, 0, 99)
    if number is None:
        return None
    if len(text) == 1 or re.search(r"[89]", text):
        return DECIMAL
    return HEXADECIMAL if number > 63 or text.startswith("0") else None


def base_of_survey(lines: Sequence[str], carriers: Sequence[Carrier]) -> int | None:
    """Base of the surveys: as set in the transcript, or the only one that most lines allow."""
    for line in reversed(lines):
        setting = _BASE_SETTING.search(line)
        if setting:
            return DECIMAL if setting[1] == "0" else HEXADECIMAL
    bases = [base for carrier in carriers if len(carrier.bases) == 1 for base in carrier.bases]
    votes = Counter(bases).most_common()
    tied = len(votes) > 1 and votes[0][1] == votes[1][1]
    return votes[0][0] if votes and not tied else None


def codes_are_decimal(carriers: Sequence[Carrier]) -> bool:
    """False where no country code is one as it stands: those models print it in hexadecimal."""
    countries, networks = (
        [carrier.texts.get(name, "").upper() for carrier in carriers] for name in ("mcc", "mnc")
    )
    codes = [text for text in countries if text.strip("F")]
    codes += [text for text in networks if re.search(r"[A-E]", text)]
    return any(map(_is_country, countries)) or len(codes) < _LEAST_CODES


def _is_country(text: str) -> bool:
    """Country codes of ITU-T E.212: by world zone, 901 shared, 001 for tests."""
    return re.fullmatch(r"[2-7]\d\d|901|999|001", text) is not None


def network_of(texts: dict[str, str], *, is_decimal: bool) -> tuple[str | None, str | None]:
    """Country and network; a network code has two digits at least, so lost zeros are restored."""
    mcc, mnc = texts.get("mcc", ""), texts.get("mnc", "")
    if not is_decimal and mcc and mnc:
        is_filler = re.fullmatch(r"F+", mnc, re.IGNORECASE)
        mcc, mnc = f"{int(mcc, 16):03d}", "F" if is_filler else str(int(mnc, 16))
    if not _is_country(mcc) or not re.fullmatch(r"\d{1,3}", mnc):
        return None, None
    return mcc, mnc.zfill(2)
