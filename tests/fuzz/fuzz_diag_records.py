"""Log records to readings and signals: `python fuzz_diag_records.py -max_total_time=3600`."""

import sys

import atheris

with atheris.instrument_imports(include=["logger", "postproc.interop.readers.diag"]):
    from logger.drivers.diag.frames import FrameReader, LogRecord
    from logger.drivers.diag.levels import ALLOWED_CODES, Decoder
    from logger.drivers.diag.seconds import Seconds
    from postproc.interop.readers.diag import CODES, Messages
    from postproc.suspicion.signalling import Signal

ALL_CODES = sorted(ALLOWED_CODES | CODES)
RECEIVERS = 2


def test_one(data: bytes) -> None:
    source = atheris.FuzzedDataProvider(data)
    frames, decoder = FrameReader(ALLOWED_CODES | CODES), Decoder()
    messages, seconds = Messages(), Seconds()
    records = frames.feed(source.ConsumeBytes(source.ConsumeIntInRange(0, 60)))
    t_ns = 0
    while source.remaining_bytes() > 2:
        code = ALL_CODES[source.ConsumeIntInRange(0, len(ALL_CODES) - 1)]
        t_ns += source.ConsumeIntInRange(-(10**9), 10**10)
        body = source.ConsumeBytes(source.ConsumeIntInRange(0, 600))
        records.append(LogRecord(code, source.ConsumeIntInRange(0, RECEIVERS), t_ns, body))
    found = []
    for record in records:
        for one in [*decoder.feed(record), *messages.feed(record)]:
            if not isinstance(one, Signal):
                found += seconds.feed(messages.with_first_name(one))
    messages.end()
    for second in [*found, *seconds.end()]:
        for reading in second.readings:
            level_dbm = reading.level_dbm
            assert level_dbm is None or -156.0 <= level_dbm <= -20.0
            assert (level_dbm is None) == (reading.n_levels is None)


if __name__ == "__main__":
    atheris.Setup(sys.argv, test_one)
    atheris.Fuzz()
