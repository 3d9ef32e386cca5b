"""Bytes of a modem through the framer and every driver: `python fuzz_at.py
-max_total_time=3600`.
"""

import re
import sys

import atheris

with atheris.instrument_imports(include=["logger"]):
    from logger.core.types import CellReading
    from logger.drivers.protocols.at import MAX_LINE, AtFramer, Reply
    from logger.drivers.protocols.redaction import redact
    from logger.drivers.registry import FAMILIES

DRIVERS = tuple(FAMILIES.values())


def events_of(data: bytes, command: str, cuts: list[int]) -> list[object]:
    framer = AtFramer()
    events: list[object] = []
    framer.send(command)
    for start, end in zip([0, *cuts], [*cuts, len(data)], strict=True):
        events += framer.feed(data[start:end])
    return [*events, *framer.flush(), framer.expire()]


def test_one(data: bytes) -> None:
    source = atheris.FuzzedDataProvider(data)
    driver = DRIVERS[source.ConsumeIntInRange(0, len(DRIVERS) - 1)]
    commands = [*driver.poll_commands, *driver.survey_commands] or [None]
    command = commands[source.ConsumeIntInRange(0, len(commands) - 1)]
    cuts = sorted(source.ConsumeIntListInRange(3, 0, 4096))
    body = source.ConsumeBytes(sys.maxsize)
    cuts = [min(cut, len(body)) for cut in cuts]
    text = command.text if command else "AT"
    whole, cut = events_of(body, text, []), events_of(body, text, cuts)
    assert whole == cut, "the events depend on the chunks"
    lines = [line for event in whole if isinstance(event, Reply) for line in event.lines]
    assert all(len(line) <= MAX_LINE for line in lines)
    tokens = set(re.findall(r"[0-9A-Za-z]+", "\n".join(lines)))
    for row in driver.read([text, *lines]):
        if isinstance(row, CellReading):
            check_identity(row, tokens)
    assert len(redact(body)) == len(body)


def check_identity(row: CellReading, tokens: set[str]) -> None:
    numbers = {
        int(token, 16) for token in tokens if re.fullmatch(r"(?:0[xX])?[0-9A-Fa-f]{1,16}", token)
    }
    numbers |= {int(token) for token in tokens if re.fullmatch(r"[0-9]{1,12}", token)}
    for value in (row.lac, row.tac, row.cid):
        assert value is None or value in numbers, row


if __name__ == "__main__":
    atheris.Setup(sys.argv, test_one)
    atheris.Fuzz()
