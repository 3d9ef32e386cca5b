"""Bytes of a receiver through the framer to fixes: `python fuzz_nmea.py -max_total_time=3600`."""

import sys

import atheris

with atheris.instrument_imports(include=["logger", "pynmea2"]):
    from logger.core.types import Fix
    from logger.drivers.protocols.line_noise import Garbage
    from logger.drivers.protocols.nmea import FixAssembler, NmeaFramer

from logger.sim.devices import sentence

KINDS = ("GNRMC", "GPGGA", "GNGSA", "GPGST", "GNGNS", "GPVTG", "GPZDA", "GPGSV")


def fixes_of(data: bytes, cuts: list[int]) -> list[tuple[int, Fix]]:
    framer, assembler = NmeaFramer(), FixAssembler()
    fixes: list[tuple[int, Fix]] = []
    for start, end in zip([0, *cuts], [*cuts, len(data)], strict=True):
        for event in framer.feed(data[start:end]):
            if not isinstance(event, Garbage):
                fixes += assembler.feed(event, 0)
    return [*fixes, *assembler.flush()]


def test_one(data: bytes) -> None:
    source = atheris.FuzzedDataProvider(data)
    body = b""
    while source.remaining_bytes() > 2:
        if source.ConsumeBool():  # a right checksum, which a fuzzer would seldom hit
            text = (
                source.ConsumeUnicodeNoSurrogates(80)
                .encode("ascii", "ignore")
                .replace(b"\r", b"")
                .decode()
            )
            kind = KINDS[source.ConsumeIntInRange(0, len(KINDS) - 1)]
            body += sentence(f"{kind},{text}".replace("$", "").replace("*", "").replace("\n", ""))
        else:
            body += source.ConsumeBytes(source.ConsumeIntInRange(0, 60))
    cuts = sorted(min(cut, len(body)) for cut in source.ConsumeIntListInRange(3, 0, 4096))
    whole = fixes_of(body, [])
    assert whole == fixes_of(body, [*cuts]), "the fixes depend on the chunks"
    for _, fix in whole:
        assert (fix.lat_deg is None) == (fix.lon_deg is None) == (not fix.valid)
        assert abs(fix.lat_deg or 0.0) <= 90
        assert abs(fix.lon_deg or 0.0) <= 180
        assert fix.utc_ns is None or fix.utc_ns >= 1_577_836_800 * 10**9


if __name__ == "__main__":
    atheris.Setup(sys.argv, test_one)
    atheris.Fuzz()
