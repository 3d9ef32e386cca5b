"""Network mode selection: read it, restrict a modem to GSM, and set it back.

This is the one exception to listening: a modem that is given another choice leaves its network and
may register anew, which transmits. It is done only if configured, and the value that is set back is
the one that the modem reported before. Sources: firmware_notes.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from logger.drivers.protocols.at import Command, Dialogue, Reply

SET_S = 12.0
"""AT+CNMP may take 10 s (SIM7600 manual); other manuals give no time."""
_TRIES = 4
_LIST = r"\d{1,2}(?:,\s*\d{0,3})*"


@dataclass(frozen=True, slots=True)
class ModeCommand:
    """One command of a family: a `line` answers its `query`, its `assignment` takes a value.

    The technologies stand in front of the first comma of a value; `gsm_only` is GSM only.
    """

    query: str
    line: str
    assignment: str
    gsm_only: str
    value: str = r"\d{1,3}"

    def value_in(self, reply: Reply) -> str | None:
        """The value that the modem reports, None for none or more than one."""
        form = re.compile(self.line.format(f"({self.value})"), re.IGNORECASE | re.ASCII)
        matches = [match for line in reply.lines if (match := form.fullmatch(line.strip()))]
        return matches[0][1].replace(" ", "") if reply.ok and len(matches) == 1 else None

    def is_value(self, text: str) -> bool:
        """Whether a text has the form of a value."""
        return re.fullmatch(self.value, text, re.ASCII) is not None

    def is_gsm(self, value: str) -> bool:
        """Whether a value is GSM only."""
        return same_mode(value, self.gsm_only)

    def set_to(self, value: str) -> str:
        """The command line that sets a value."""
        return self.assignment.format(value)


def same_mode(one: str, other: str) -> bool:
    """Whether two values choose the same technologies."""
    return one.partition(",")[0] == other.partition(",")[0]


CNMP = (ModeCommand("AT+CNMP?", r"\+CNMP:\s*{}", "AT+CNMP={}", "13"),)
NWSCANMODE = (
    ModeCommand(
        'AT+QCFG="nwscanmode"',
        r'\+QCFG:\s*"nwscanmode",\s*{}(?:,\d)?',
        'AT+QCFG="nwscanmode",{},1',  # 1: at once, not at the next start
        "1",
    ),
)
URAT = (ModeCommand("AT+URAT?", r"\+URAT:\s*{}", "AT+URAT={}", "0", _LIST),)
WS46 = (ModeCommand("AT+WS46?", r"(?:\+WS46:\s*)?{}", "AT+WS46={}", "12", r"\d\d"),)
SXRAT = (ModeCommand("AT^SXRAT?", r"\^SXRAT:\s*{}", "AT^SXRAT={}", "0", _LIST),)
SELRAT = (ModeCommand("AT!SELRAT?", r"!SELRAT:\s*{}\b.*", "AT!SELRAT={}", "02", r"[0-9A-F]{2}"),)
SYSCFG = (  # 40000000, 2 and 4: bands, roaming and domain stay as they are
    ModeCommand(
        "AT^SYSCFGEX?",
        r'\^SYSCFGEX:\s*"{}",.*',
        'AT^SYSCFGEX="{}",40000000,2,4,40000000,,',
        "01",
        r"(?:\d\d){1,5}",
    ),
    ModeCommand(
        "AT^SYSCFG?", r"\^SYSCFG:\s*{},.*", "AT^SYSCFG={},40000000,2,4", "13,1", r"\d{1,2},\d"
    ),
)
GTRAT = (
    ModeCommand("AT+GTRAT?", r"\+GTRAT:\s*{}", "AT+GTRAT={}", "0", _LIST),
    ModeCommand("AT+XACT?", r"\+XACT:\s*{}", "AT+XACT={}", "0", _LIST),
)


def ask_model() -> Dialogue[str | None]:
    """The model name that the modem reports; its device number is never read."""
    reply = yield Command("AT+CGMM")
    text = " ".join(line.strip() for line in reply.lines)
    return text if reply.ok and text else None


def read_mode(commands: Sequence[ModeCommand]) -> Dialogue[tuple[ModeCommand, str] | None]:
    """The first of the commands that the modem answers, and its value.

    A value counts once it is reported twice in a row: a damaged one must not be set later.
    """
    for command in commands:
        before = None
        for _ in range(_TRIES):
            reply = yield Command(command.query)
            if reply.final is not None and not reply.ok:
                break
            value = command.value_in(reply)
            if value is not None and value == before:
                return command, value
            before = value
    return None


def set_mode(command: ModeCommand, value: str) -> Dialogue[str | None]:
    """Set a value; returns the one that the modem has then, None where it reports none.

    A modem that reports allowed and preferred technologies may accept only the first.
    """
    shorter = value.partition(",")[0]
    values = (
        [value, shorter] if command.assignment.endswith("={}") and shorter != value else [value]
    )
    found = None
    for text in values:
        yield Command(command.set_to(text), timeout_s=SET_S)
        found = command.value_in((yield Command(command.query)))
        if found is not None and same_mode(found, value):
            break
    return found
