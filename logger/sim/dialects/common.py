"""Replies of all modems (3GPP TS 27.007) in a world of GSM cells: network, level."""

from collections.abc import Mapping

from logger.sim.air import Air
from logger.sim.dialects.dialect import NETWORK_NAME, NO_SIM, Answer, Listing, Settings, setting

GSM_ACT = 0
SETTINGS = {
    "+CMEE": setting("0", "[0-2]"),
    "+CREG": setting("0", "[0-2]"),
    "+CGREG": setting("0", "[0-2]"),
    "+COPS": setting("0,0", "3,[0-2]"),
}
COPS_SCAN_S = 30.0


def csq(air: Air, _: Settings) -> Answer:
    level = 99 if air.serving is None else min(max((air.serving.dbm + 113) // 2, 0), 31)
    return [f"+CSQ: {level},{0 if air.serving else 99}"]


def cesq(air: Air, _: Settings) -> Answer:
    return [f"+CESQ: {air.serving.rxlev if air.serving else 99},99,255,255,255,255"]


def registration(name: str) -> Listing:
    """Answer of a modem in the network: `n,stat` and, where it was set, area and cell."""

    def listing(air: Air, settings: Settings) -> Answer:
        n = settings[name]
        if air.serving is None:
            return [f"{name}: {n},2"]
        cell = air.serving.cell
        return [f"{name}: {n},1" + (f',"{cell.lac:04X}","{cell.cid:04X}"' if n == "2" else "")]

    return listing


def no_registration(name: str) -> Listing:
    return lambda _, settings: [f"{name}: {settings[name]},0"]


def network(air: Air, settings: Settings) -> Answer:
    if air.serving is None:
        return ["+COPS: 0"]
    form = settings["+COPS"][-1]
    cell = air.serving.cell
    name = f"{cell.mcc}{cell.mnc}" if form == "2" else NETWORK_NAME
    return [f'+COPS: 0,{form},"{name}",{GSM_ACT}']


def networks(air: Air, _: Settings) -> Answer:
    plmns = dict.fromkeys(f"{one.cell.mcc}{one.cell.mnc}" for one in air.decoded_cells)
    offered = ",".join(
        f'(1,"{NETWORK_NAME}","{NETWORK_NAME}","{plmn}",{GSM_ACT})' for plmn in plmns
    )
    return [f"+COPS: {offered},,(0,1,3,4),(0,1,2)"]


EPS: Mapping[str, Listing] = {"+CEREG?": no_registration("+CEREG"), "+CESQ": cesq}
"""What modems of LTE know besides, while they camp on GSM."""
EPS_SETTINGS = {"+CEREG": setting("0", "[0-2]")}

ANYWHERE: Mapping[str, Listing] = {"+CSQ": csq, "+COPS=?": networks}
REGISTERED: Mapping[str, Listing] = {
    "+CPIN?": lambda *_: ["+CPIN: READY"],
    "+CREG?": registration("+CREG"),
    "+CGREG?": no_registration("+CGREG"),
    "+COPS?": network,
}
NO_CARD: Mapping[str, Listing] = {
    "+CPIN?": lambda *_: NO_SIM,
    "+CREG?": no_registration("+CREG"),
    "+CGREG?": no_registration("+CGREG"),
    "+COPS?": lambda *_: ["+COPS: 0"],
}
