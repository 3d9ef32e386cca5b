"""Replies to commands of the drivers, and the redaction of what comes in pieces of any size."""

from logger.drivers.protocols.redaction import Redactor

REPLIES = {
    "AT+CENG?": (
        b'\r\n+CENG: 1,1\r\n\r\n+CENG: 0,"0017,45,00,262,01,09,3039,05,05,1267,255"\r\n@'
        b'+CENG: 1,"0021,30,12,303a,262,01,1267"\r\n\r\nOK\r\n'
    ),
    "AT+CNETSCAN": (
        b'\r\nOperator:"T-Mobile USA",MCC:310,MNC:260,Rxlev:53,Cellid:CF00,Arfcn:1709\r\n@'
        b'Operator:"o2 - de",MCC:262,MNC:07,Rxlev:53,Cellid:CF00,Arfcn:7,Lac:3C4D,Bsic:25\r\nOK\r\n'
    ),
    "AT#CSURV=0,62": (
        b"\r\nNetwork survey started ...\r\n\r\narfcn: 48 bsic: 24 rxLev: -52 ber: 0.00 mcc: 262"
        b" mnc: 1 lac: 33281 cellId: 3648 cellStatus: CELL_SUITABLE numArfcn: 1 arfcn: 48"
        b" numChannels: 5 array: 14 19 22 48 982\r\n\r\n@"
        b"1005,26,-76,0,262,02,23456,34567,CELL_SUITABLE,0\r\narfcn: 30 rxLev: -88\r\n"
        b"Network survey ended\r\n\r\nOK\r\n"
    ),
    "AT+COPS=5": (
        b"\r\nMCC:222, MNC:88, TAC:562c, CI:57367043, DLF: 1325, ULF:19325, PCI:163, RSRP LEV:25,"
        b" RSRQ LEV:1\r\n@\r\nMCC:310, MNC:260, LAC:ab22, CI:b633, BSIC:24, Arfcn:00594,"
        b" RXLEV:017\r\n\r\nOK\r\n"
    ),
    "AT+COPS=?": (
        b'\r\n+COPS: (2,"Telekom.de","TMO","26201",7),\r\n@(1,"Vodafone.de","Voda","26202",2),,'
        b"(0,1,2,3,4),(0,1,2)\r\n\r\nOK\r\n"
    ),
    "AT^MONI": (
        b"\r\nServing Cell                                        I Dedicated channel\r\n@"
        b"1013  21 -71 001 01 1001 0103 7   7   33  -105  33 \tI No connection\r\n\r\nOK\r\n"
    ),
    "AT!GSTATUS?": (
        b"\r\n!GSTATUS: \r\nCurrent Time:  444231\t\tTemperature: 32\r\n@Tx Power:      --\t\t"
        b"TAC:         0001 (1)\r\nRSRQ (dB):     -8.0\t\tCell ID:     00005101 (20737)\r\nOK\r\n"
    ),
    "AT+GTCCINFO?": (
        b"\r\n+GTCCINFO:\r\nLTE service cell:\r\n1,4,262,02,BFD3,2D4201,189C,30,120,50,16,42,42,26"
        b"\r\n@LTE neighbor cell:\r\n2,4,,,,,189C,190,,24,24,2\r\n\r\nOK\r\n"
    ),
    "ATI": b"\r\nManufacturer: Sierra Wireless, Incorporated\r\n@Model: MC7455\r\n\r\nOK\r\n",
    "AT+CGMM": b"\r\nSIM5360E\r\n@\r\nOK\r\n",
    "AT+WS46?": b"\r\n@12\r\n\r\nOK\r\n",
}
"""Replies with rows that have no name, and some that have; @ is where a line is planted."""


def redact_in_pieces(data, rng, *commands):
    redactor, out = Redactor(), b""
    for command in commands:
        redactor.send(command.encode() + b"\r")
    while data:
        n = rng.choice((1, rng.randint(1, 8), rng.randint(1, 200)))
        out, data = out + redactor.feed(data[:n]), data[n:]
    return out + redactor.flush()
