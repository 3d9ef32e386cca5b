"""What distinguishes one modem from another: identity, settings and replies.

Formats are written from manuals and captures (see firmware_notes), independently of the drivers
that read them.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from logger.sim.air import Air

Settings = Mapping[str, str]
"""Values of the settings by name, {"+CENG": "1,1"}; "=" is the argument of the command."""
Answer = Sequence[str] | int
"""Blocks of text before OK, or the number of a +CME ERROR (3GPP TS 27.007 9.2)."""
Listing = Callable[[Air, Settings], Answer]

IMEI = "004999010640000"
"""IMEI of a test device; modems may print theirs unsolicited."""
NETWORK_NAME = "Test PLMN 1-1"
NO_SIM = 10
NO_SERVICE = 30


@dataclass(frozen=True, slots=True)
class Setting:
    """The value after power-up, and the form of accepted ones; parts left out stay as they are.

    What is `stored` is as it was before the power went.
    """

    default: str
    form: re.Pattern[str]
    stored: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Dialect:
    """One model.

    `replies` are by command without its AT, in capitals; one that ends with "=" takes any argument.
    `takes_s` is how long slow ones take, `unsolicited` what the modem prints by itself every few
    seconds; `registered` ones have a SIM card; on `abortable` ones a character ends a slow command,
    the others read it afterwards.
    """

    name: str
    identity: Mapping[str, Sequence[str]]
    replies: Mapping[str, Listing]
    settings: Mapping[str, Setting] = field(default_factory=dict)
    takes_s: Mapping[str, float] = field(default_factory=dict)
    unsolicited: Listing | None = None
    boot: Sequence[str] = ("RDY", "+CFUN: 1", "Call Ready")
    registered: bool = False
    abortable: bool = False


def setting(default: str, form: str, *, stored: bool = False) -> Setting:
    return Setting(default, re.compile(form), stored)


def identity_replies(
    ati: Sequence[str], maker: str, model: str, revision: str
) -> dict[str, Sequence[str]]:
    """Answers to the four commands that ask for the identity."""
    return {"I": ["\r\n".join(ati)], "+CGMI": [maker], "+CGMM": [model], "+CGMR": [revision]}


def block(lines: Sequence[str]) -> list[str]:
    """Lines without blank ones in between; nothing for none."""
    return ["\r\n".join(lines)] if lines else []


def bsic_octal(bsic: int) -> str:
    """Network and base station colour code, a digit each."""
    return f"{bsic:02o}"
