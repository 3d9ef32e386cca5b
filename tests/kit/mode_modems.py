"""Simulated modems with each command that selects technologies, and one that is observed."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from logger.device.mode_switch import FILE
from logger.sim.devices import SimulatedModem
from logger.sim.dialects import Dialect, identity_replies, setting
from logger.sim.scenario import scenario
from tests.kit.dialects import DIALECTS

WALK = scenario("clear")


def _another(
    name: str, maker_and_model, setting_name: str, default: str, form: str, listing
) -> Dialect:
    """A simulated modem under another name, with one command more."""
    dialect = DIALECTS[name]
    command = f"{setting_name}?"
    replies = {key: reply for key, reply in dialect.replies.items() if key != "^SYSCFGEX?"}
    settings = {key: kind for key, kind in dialect.settings.items() if key != "^SYSCFGEX"}
    return replace(
        dialect,
        name=maker_and_model[1],
        identity=identity_replies([maker_and_model[1]], *maker_and_model, "1.0"),
        replies={**replies, command: lambda _, settings: listing(settings[setting_name])},
        settings={**settings, setting_name: setting(default, form, stored=True)},
    )


MODELS = {
    "sim7600": DIALECTS["sim7600"],
    "sim7000": DIALECTS["sim7000"],
    "ec25": DIALECTS["ec25"],
    "me909s": DIALECTS["me909s"],
    "e173": _another(
        "me909s",
        ("huawei", "E173"),
        "^SYSCFG",
        "2,0",
        "(?:2|13|14),[0-3](?:,40000000,2,4)?",
        lambda v: [f"^SYSCFG:{v.split(',4')[0]},3FFFFFFF,1,2"],
    ),
    "le910": _another("ge864", ("Telit", "LE910-EUG"), "+WS46", "25", "12|22|25|28", lambda v: [v]),
    "sara-u201": _another(
        "sara-g350",
        ("u-blox", "SARA-U201"),
        "+URAT",
        "1,2",
        "[0-2](?:,[02])?",
        lambda v: [f"+URAT: {v}"],
    ),
    "ehs6": _another(
        "bgs2",
        ("Cinterion", "EHS6"),
        "^SXRAT",
        "1,2",
        "[0-2](?:,[02])?",
        lambda v: [f"^SXRAT: {v.replace(',', ', ')}"],
    ),
    "wp7607": _another(
        "mc7455",
        ("Sierra Wireless, Incorporated", "WP7607"),
        "!SELRAT",
        "00",
        "0[0126]",
        lambda v: [f"!SELRAT: {v}, Automatic"],
    ),
    "l610": _another(
        "l850", ("Fibocom", "L610"), "+GTRAT", "10,3,0", r"\d+(?:,\d+)*", lambda v: [f"+GTRAT: {v}"]
    ),
    "xmm7160": _another(
        "l850",
        ("Fibocom", "L850-GL"),
        "+XACT",
        "6,2,1,101,103",
        r"\d+(?:,\d+)*",
        lambda v: [f"+XACT: {v}"],
    ),
}
"""One modem of each family and command that can restrict itself to GSM."""


class ObservedModem:
    """A modem on the walk that stores the lines it receives.

    It also stores the content of the file of modes at each of them.
    """

    def __init__(self, dialect: Dialect, folder: Path, now_s=lambda: 50.0) -> None:
        rng = np.random.default_rng(1)
        self.modem = SimulatedModem(dialect, WALK.world, WALK.walk, now_s, rng)
        self.lines: list[str] = []
        self.file_at_line: dict[str, str] = {}
        self._file = folder / FILE
        self._line = b""

    def setting(self, name: str) -> str:
        return self.modem._settings[name]

    def feed(self, data: bytes) -> bytes:
        *lines, self._line = (self._line + data).split(b"\r")
        for line in lines:
            self.lines.append(line.decode("latin-1"))
            if self._file.exists():
                self.file_at_line.setdefault(self.lines[-1], self._file.read_text())
        return self.modem.feed(data)

    def unsolicited(self) -> bytes:
        return self.modem.unsolicited()
