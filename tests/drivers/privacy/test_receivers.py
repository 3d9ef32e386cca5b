import json

from logger.drivers.privacy.redaction import redact
from logger.drivers.protocols.gpsd import GpsdFramer
from logger.drivers.protocols.nmea import FixAssembler, NmeaFramer, Sentence


def _fixes(data):
    framer, assembler, fixes, n_noise = NmeaFramer(), FixAssembler(), [], 0
    for event in framer.feed(data):
        if isinstance(event, Sentence):
            fixes += assembler.feed(event, 0)
        else:
            n_noise += len(event.data)
    return [*fixes, *assembler.flush()], n_noise


def test_fixes_and_noise_of_all_recorded_receivers_are_the_same(corpus):
    """A text in a sentence is masked, and its checksum is that of what is left."""
    paths = sorted(corpus.glob("nmea/*.nmea"))
    assert paths
    for path in paths:
        data = path.read_bytes()
        assert _fixes(redact(data)) == _fixes(data)


def test_a_receiver_keeps_its_numbers_and_loses_its_serial_number():
    data = b"$PDTINFO,UM621-02,G1B1L1E1,V1.2,R6.0.0.0Build2810,2310414000033,PC12B4231700429*73\r\n"
    out = redact(data)
    assert out.startswith(b"$PDTINFO,xxxxx-xx,")
    assert b"2310414" not in out
    assert b"4231700429" not in out
    assert all(isinstance(event, Sentence) for event in NmeaFramer().feed(out))


def test_gpsd_keeps_what_is_read_of_its_reports():
    device = {
        "class": "DEVICE",
        "path": "/dev/serial/by-id/usb-u-blox_7-if00",
        "driver": "u-blox",
        "sernum": "LF728387390410",
        "subtype": 'SW 1.0, 2310414000033, \u00e9"\\',
        "activated": "2026-11-21T12:00:00.000Z",
        "bps": 9600,
        "id": 355789041234567,
    }
    text = json.dumps(device).encode().replace(b'": ', b'":').replace(b", ", b",")
    out = redact(text + b"\r\n")
    left = json.loads(out)
    assert {key for key in device if left[key] != device[key]} == {"sernum", "subtype", "id"}
    assert b"2310414" not in out
    assert list(GpsdFramer().feed(out)) == list(GpsdFramer().feed(text + b"\r\n"))
