"""A walk past one cell, and what the live estimate says of it."""

from logger.core.suspicion.rules import rules_note
from logger.core.types import Fix, Record, Scan
from tests.kit import runs

S = 10**9


def walk(n):
    for t in range(n):
        yield 2 * t, Record(t * S, "gnss", Fix(True, None, 52.0, 13.0 + 2e-5 * t, hdop=1.0))
        yield 2 * t + 1, Record(t * S + 1, "modem", Scan(t * S, (runs.reading(1, -70.0 - t % 7),)))


def next_values(inbox):
    values = []
    while (record := inbox.get(0.0)) is not None:
        values.append(record.value)
    return [v for v in values if v != rules_note()]
