"""What of the rows of a poll becomes a scan."""

from logger.core.types import CellReading
from logger.device.clock import Clock
from logger.device.modem_exchange import ModemExchange
from logger.drivers.protocols.at import Command, Reply
from logger.drivers.quectel import Quectel
from logger.drivers.quectel_gsm import QuectelGsm
from logger.drivers.reading.recognition import NumberHistory

EC25 = """+QENG: "servingcell","NOCONN"
+QENG: "LTE","FDD",262,02,2D00A0B,135,1300,3,5,5,C3A1,-98,-11,-67,12,25
+QENG: "neighbourcell intra","LTE",1300,135,-11,-98,-67,0,25,7,16,6,44
+QENG: "neighbourcell intra","LTE",1300,136,-16,-108,-77,0,18,7,16,6,44"""
M66 = """+QENG: 1,4
+QENG: 0,262,02,1b2c,4d5e,72,11,-70,33,33,5,0,x,x,x,x,x,x,x
+QENG: 1,1,80,-76,30,35,35,262,02,1b2c,4d5f
+QENG: 4,3,(72,-70,11),(80,-76,30),(16,-101,17)"""


class FakeLink:
    def __init__(self):
        self.clock, self.known, self.scans = Clock(), NumberHistory(), []

    def emit(self, scan, _end_ns):
        self.scans.append(scan)


def scan_of(driver, reply) -> tuple[CellReading, ...]:
    link = FakeLink()
    ModemExchange(link, driver).emit_scan(0, 1, driver.read(reply.splitlines()))
    return link.scans[0].readings


def test_a_list_that_repeats_a_cell_does_not_double_its_level():
    """Two readings of one level would make a position seem surer than it is."""
    assert [one.pci for one in scan_of(Quectel(), EC25)] == [135, 136]
    assert [one.arfcn for one in scan_of(QuectelGsm(), M66)] == [72, 80, 16]


def test_replies_are_those_of_the_latest_dialogue():
    """A modem that is asked for hours and never polled would fill the memory."""

    def asks(n):
        for _ in range(n):
            yield Command("AT")

    exchange = ModemExchange(FakeLink(), Quectel())
    exchange.ask = lambda command: exchange.replies.append(Reply(command.text, (), "OK"))
    for n in (3, 2):
        exchange.talk(asks(n))
        assert len(exchange.replies) == n
