"""A modem of 3GPP TS 27.007 alone, which has a cell with a SIM card only."""

from logger.sim.dialects import COPS_SCAN_S, EPS, EPS_SETTINGS, SETTINGS, Dialect, identity_replies

PLAIN = Dialect(
    "plain",
    identity_replies(["Modem 1"], "Example", "Modem 1", "1.0"),
    replies=EPS,
    settings=SETTINGS | EPS_SETTINGS,
    takes_s={"+COPS=?": COPS_SCAN_S},
    boot=("RDY",),
    registered=True,
)
