"""A modem that knows nothing but 3GPP TS 27.007; it needs a SIM card to have a cell at all."""

from logger.sim.dialects.common import COPS_SCAN_S, EPS, EPS_SETTINGS, SETTINGS
from logger.sim.dialects.dialect import Dialect, who

PLAIN = Dialect(
    "plain",
    who(["Modem 1"], "Example", "Modem 1", "1.0"),
    replies=EPS,
    settings=SETTINGS | EPS_SETTINGS,
    takes_s={"+COPS=?": COPS_SCAN_S},
    boot=("RDY",),
    registered=True,
)
