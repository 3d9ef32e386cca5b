"""NMEA sentences of one receiver with right checksums, and the fixes that they make."""

from datetime import UTC, datetime
from functools import reduce
from operator import xor

from logger.core.types import Fix
from logger.drivers.protocols.nmea import FixAssembler, NmeaFramer

NOON_NS = int(datetime(2024, 9, 21, 12, tzinfo=UTC).timestamp()) * 10**9

BOTH = Fix(
    valid=True,
    utc_ns=NOON_NS,
    lat_deg=52.5,
    lon_deg=13.25,
    alt_m=45.5,
    hdop=1.1,
    sats_used=8,
    quality=1,
    speed_mps=2.0 * 1852 / 3600,
    course_deg=84.4,
)
"""What GGA and RMC of one epoch, as `gga()` and `rmc()` write them, report together."""


def nmea(body):
    return f"${body}*{reduce(xor, body.encode()):02X}"


def fixes(*texts, flush=True):
    """Fixes of sentences stamped 0, 1, 2, ..."""
    assembler = FixAssembler()
    found = []
    for t_ns, text in enumerate(texts):
        for sentence in NmeaFramer().feed(text.encode()):
            found += assembler.feed(sentence, t_ns)
    return found + list(assembler.flush()) if flush else found


def gga(
    time="120000.00", place="5230.0000,N,01315.0000,E", quality="1", tail="08,1.1,45.5,M,40.0,M,,"
):
    return nmea(f"GPGGA,{time},{place},{quality},{tail}")


def rmc(
    time="120000.00",
    status="A",
    place="5230.0000,N,01315.0000,E",
    date="210924",
    mode="A,V",
    motion="2.0,84.4",
):
    return nmea(f"GPRMC,{time},{status},{place},{motion},{date},,,{mode}")


def gst(time="120000.00", lat_m="3.0", lon_m="4.0"):
    return nmea(f"GNGST,{time},20,,,,{lat_m},{lon_m},5.0")


def gsa(mode, system="1", hdop="0.9"):
    return nmea(f"GNGSA,A,{mode},01,02,03,04,,,,,,,,,1.5,{hdop},1.2,{system}")
