"""Bytes of a modem through frames and log records: `python fuzz_diag.py -max_total_time=3600`."""

import sys

import atheris

with atheris.instrument_imports(include=["logger"]):
    from logger.drivers.diag.frames import FrameReader, LogRecord
    from logger.drivers.diag.levels import ALLOWED_CODES, Decoder
    from logger.drivers.diag.seconds import Seconds

from tests.kit.diag_capture import T0_NS, frame, log_frame

CODES = sorted(ALLOWED_CODES)


def records_of(data: bytes, cuts: list[int]) -> list[LogRecord]:
    reader = FrameReader(ALLOWED_CODES)
    parts = zip([0, *cuts], [*cuts, len(data)], strict=True)
    return [record for start, end in parts for record in reader.feed(data[start:end])]


def test_one(data: bytes) -> None:
    source = atheris.FuzzedDataProvider(data)
    stream = b""
    while source.remaining_bytes() > 2:
        body = source.ConsumeBytes(source.ConsumeIntInRange(0, 200))
        match source.ConsumeIntInRange(0, 2):  # a right sum, which a fuzzer would seldom hit
            case 0:
                code = CODES[source.ConsumeIntInRange(0, len(CODES) - 1)]
                stream += log_frame(code, T0_NS, body)  # type: ignore[no-untyped-call]
            case 1:
                stream += frame(body)  # type: ignore[no-untyped-call]
            case _:
                stream += body
    cuts = sorted(min(cut, len(stream)) for cut in source.ConsumeIntListInRange(3, 0, 4096))
    records = records_of(stream, [])
    assert records == records_of(stream, [*cuts]), "the records depend on the chunks"
    decoder, seconds = Decoder(), Seconds()
    for record in records:
        for one in decoder.feed(record):
            assert one.level_dbm is None or -160.0 <= one.level_dbm <= -20.0
            seconds.feed(one)
    seconds.end()


if __name__ == "__main__":
    atheris.Setup(sys.argv, test_one)
    atheris.Fuzz()
