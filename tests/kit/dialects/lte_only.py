"""Sierra MC7455 and Fibocom L850: no GSM reply of these modems is known (129, 131, 139).

They report the transmitters as LTE cells: area, cell, channel and colour code stand for area, cell,
channel and PCI. Neighbours have no identity.
"""

from logger.sim.dialects import (
    COPS_SCAN_S,
    EPS,
    EPS_SETTINGS,
    IMEI,
    SETTINGS,
    Answer,
    Dialect,
    Settings,
    block,
    identity_replies,
)
from logger.sim.world import Air, ReceivedCell
from tests.kit.dialects import modes

RSRQ_DB, SINR_DB = -8.0, 8.6
RSSI_OVER_RSRP_DB = 28  # of 10 MHz


def status(air: Air, _: Settings) -> Answer:
    """Pairs of label and value, two to a line; numbers are hexadecimal (decimal)."""
    one = air.serving
    if one is None:
        return block(
            ["!GSTATUS: ", "Mode:        ONLINE         ", "System mode:   No service     "]
        )
    cell = one.cell
    rssi_dbm = one.dbm + RSSI_OVER_RSRP_DB
    lines = [
        "!GSTATUS: ",
        "Current Time:  444231\t\tTemperature: 32",
        "Reset Counter: 1\t\tMode:        ONLINE         ",
        "System mode:   LTE        \tPS state:    Not attached ",
        "LTE band:      B1     \t\tLTE bw:      10 MHz  ",
        f"LTE Rx chan:   {cell.arfcn}\t\tLTE Tx chan: {cell.arfcn + 18000}",
        "EMM state:     Deregistered     \tLimited Service ",
        f"PCC RxM RSSI:  {rssi_dbm}\t\tPCC RxM RSRP:  {one.dbm}",
        f"PCC RxD RSSI:  {rssi_dbm - 2}\t\tPCC RxD RSRP:  {one.dbm - 2}",
        f"Tx Power:      --\t\tTAC:         {cell.lac:04X} ({cell.lac})",
        f"RSRQ (dB):     {RSRQ_DB}\t\tCell ID:     {cell.cid:08X} ({cell.cid})",
        f"SINR (dB):      {SINR_DB}",
    ]
    return block(lines)


def lte_information(air: Air, _: Settings) -> Answer:
    """Tables: the serving cell, cells on its channel, cells on others."""
    one = air.serving
    if one is None:
        return block(
            [
                "!LTEINFO: ",
                "Serving:   EARFCN MCC MNC   TAC      CID Bd D U SNR PCI  RSRQ   RSRP   RSSI RXLV",
            ]
        )
    cell = one.cell
    where = f"{cell.arfcn:17d} {cell.mcc} {cell.mnc:>3} {cell.lac:5d} {cell.cid:08X}"
    serving = [
        "!LTEINFO: ",
        "Serving:   EARFCN MCC MNC   TAC      CID Bd D U SNR PCI  RSRQ   RSRP   RSSI RXLV",
        f"{where}  1 3 3 {SINR_DB:3.0f} {_levels(one)} --",
    ]
    same = [
        "IntraFreq:                                          PCI  RSRQ   RSRP   RSSI RXLV",
        " " * 52 + _levels(one) + " --",
    ]
    other = ["InterFreq: EARFCN ThresholdLow ThresholdHi Priority PCI  RSRQ   RSRP   RSSI RXLV"]
    other += [
        f"{near.cell.arfcn:17d}            0           0        0 {_levels(near)}   0"
        for near in air.neighbours
    ]
    return ["\r\n".join(part) for part in (serving, same, other)]


def _levels(one: ReceivedCell) -> str:
    rssi_dbm = one.level_dbm + RSSI_OVER_RSRP_DB
    return f"{one.cell.bsic:3d} {RSRQ_DB:5.1f} {one.level_dbm:6.1f} {rssi_dbm:6.1f}"


def cells(air: Air, _: Settings) -> Answer:
    """One row for each cell; identity and channel hexadecimal, levels indices of 27.007."""
    one = air.serving
    if one is None:
        return ["+GTCCINFO:"]
    cell = one.cell
    identity = f"{cell.mcc},{cell.mnc},{cell.lac:X},{cell.cid:X}"
    serving = f"1,4,{identity},{cell.arfcn:X},{cell.bsic:X},101,50,16,{_rows(one)}"
    near = [
        f"2,4,,,,,{other.cell.arfcn:X},{other.cell.bsic:X},,{_rows(other)}"
        for other in air.neighbours
    ]
    return [
        "\r\n".join(
            [
                "+GTCCINFO:",
                "LTE service cell:",
                serving,
                *(["LTE neighbor cell:", *near] if near else []),
            ]
        )
    ]


def _rows(one: ReceivedCell) -> str:
    rsrp = min(max(one.dbm + 141, 0), 97)
    return f"{rsrp},{rsrp},{round((RSRQ_DB + 20) * 2)}"


SIERRA_ATI = (
    "Manufacturer: Sierra Wireless, Incorporated",
    "Model: MC7455",
    "Revision: SWI9X30C_02.24.05.06 r7040 CARMD-EV-FRMWR2 2017/05/19 06:23:09",
    f"IMEI: {IMEI}",
    "IMEI SV: 20",
    "+GCAP: +CGSM",
)
MC7455 = Dialect(
    "mc7455",
    identity_replies(
        SIERRA_ATI,
        "Sierra Wireless, Incorporated",
        "MC7455",
        SIERRA_ATI[2].removeprefix("Revision: "),
    ),
    replies={"!GSTATUS?": status, "!LTEINFO?": lte_information, **EPS, **modes.SELRAT},
    settings=SETTINGS | EPS_SETTINGS | modes.SELRAT_SETTINGS,
    takes_s={"+COPS=?": COPS_SCAN_S},
    boot=(),
)
L850 = Dialect(
    "l850",
    identity_replies(
        ["FIBOCOM L850-GL"],
        '+CGMI: "FIBOCOM"',
        '+CGMM: "L850-GL"',
        '+CGMR: "18500.5001.00.02.24.03"',
    ),
    replies={"+GTCCINFO?": cells, **EPS, **modes.XACT},
    settings=SETTINGS | EPS_SETTINGS | modes.XACT_SETTINGS,
    takes_s={"+COPS=?": COPS_SCAN_S},
    boot=(),
)
