"""Speed of the framers and parsers beside the libraries, over the same bytes in one run.

python benchmarks/drivers.py
"""

import io
import time
from collections.abc import Callable, Iterable
from importlib import import_module
from importlib.util import find_spec
from statistics import median

import pynmea2

from logger.drivers.protocols.at import AtFramer, Reply
from logger.drivers.protocols.nmea import FixAssembler, NmeaFramer, Sentence
from logger.drivers.protocols.redaction import Redactor
from logger.drivers.sim800 import Sim800
from logger.sim.devices import sentence

EPOCHS = 2_000
CHUNK = 64
RMC = "GNRMC,120000.00,A,5231.00000,N,01324.00000,E,2.7,90.0,210926,,,A,V"
GGA = "GNGGA,120000.00,5231.00000,N,01324.00000,E,1,09,0.9,34.0,M,40.0,M,,"
GSA = "GNGSA,A,3,02,05,12,15,21,24,25,29,,,,,1.68,0.92,1.41,1"
GST = "GNGST,120000.00,20,,,,1.9,1.4,3.8"
PEERS = {"pynmeagps": "NMEAReader", "pyubx2": "UBXReader"}
REPLY = (
    b"\r\n+CENG: 1,1\r\n\r\n"
    b'+CENG: 0,"0666,21,00,310,260,08,4e72,04,03,0113,255"\r\n'
    b'+CENG: 1,"1688,16,25,a53f,310,260,0113"\r\n+CENG: 2,"1702,14,51,a53d,310,260,0113"\r\n'
    b'+CENG: 3,"1692,13,20,4e71,310,260,0113"\r\n+CENG: 4,"1696,13,30,a53e,310,260,0113"\r\n'
    b'+CENG: 5,"1701,08,40,5e58,310,260,0113"\r\n+CENG: 6,"1698,06,62,4f2f,310,260,0113"\r\n'
    b"\r\nOK\r\n"
)


def chunks(data: bytes) -> list[bytes]:
    return [data[i : i + CHUNK] for i in range(0, len(data), CHUNK)]


def read_nmea(pieces: list[bytes]) -> None:
    framer, assembler = NmeaFramer(), FixAssembler()
    for piece in pieces:
        for event in framer.feed(piece):
            if isinstance(event, Sentence):
                for _ in assembler.feed(event, 0):
                    pass


def pynmea2_alone(lines: list[str]) -> None:
    for line in lines:
        pynmea2.parse(line, check=True)


def read_by_peer(reader: Callable[[io.BytesIO], Iterable[object]], data: bytes) -> None:
    for _ in reader(io.BytesIO(data)):
        pass


def read_ceng(replies: int) -> None:
    driver = Sim800()
    for _ in range(replies):
        framer = AtFramer()
        framer.send("AT+CENG?")
        for piece in chunks(REPLY):
            for event in framer.feed(piece):
                if isinstance(event, Reply):
                    driver.rows_in(event.lines)


def redact(pieces: list[bytes]) -> None:
    redactor = Redactor()
    for piece in pieces:
        redactor.feed(piece)


def per_second(run: Callable[[], None], count: int) -> float:
    rates = []
    for _ in range(5):
        start = time.process_time()
        run()
        rates.append(count / (time.process_time() - start))
    return median(rates)


def main() -> None:
    epoch = [sentence(text) for text in (RMC, GGA, GSA, GST)]
    data = b"".join(epoch) * EPOCHS
    pieces = chunks(data)
    lines = [line.decode().strip() for line in epoch] * EPOCHS
    ours = per_second(lambda: read_nmea(pieces), len(lines))
    theirs = per_second(lambda: pynmea2_alone(lines), len(lines))
    print(f"NMEA bytes to fixes       {ours:9.0f} sentences/s")
    print(f"pynmea2.parse alone       {theirs:9.0f} sentences/s, ratio {ours / theirs:.2f}")
    for name, reader in PEERS.items():
        if find_spec(name) is None:
            print(f"{name} is not installed")
            continue
        read = getattr(import_module(name), reader)
        peer = per_second(lambda read=read: read_by_peer(read, data), len(lines))
        print(f"{name + ' bytes to messages':25} {peer:9.0f} sentences/s, ratio {ours / peer:.2f}")
    print(f"AT bytes to CENG readings {per_second(lambda: read_ceng(1000), 8000):9.0f} lines/s")
    for name, sent in {"NMEA": data, "CENG": REPLY * EPOCHS}.items():
        rate = per_second(lambda sent=sent: redact(chunks(sent)), len(sent))
        print(f"{name + ' redacted':25} {rate / 1e6:9.2f} MB/s")


if __name__ == "__main__":
    main()
