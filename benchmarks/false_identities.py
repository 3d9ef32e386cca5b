"""False identities and values that one damaged byte makes, for each family of modems.

python benchmarks/false_identities.py [--corpus FOLDER] [--family NAME ...]

Every byte of every reply in the tests' data, and of the replies in FOLDER, is lost, doubled and
changed in turn. A row is false where it names a cell, a level or a channel that the reply does not;
an identity that is marked unsure is no false one. Replies come alone, as the first that a modem
sends; then each damaged one comes between two whole ones, and only a cell that two scans have heard
counts. Whole replies with an unsure identity are counted too: alone, and after an earlier reply. At
last each reply comes a hundred times, every fifth of them with a byte lost or doubled: `session`.
"""

import argparse
import random
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from logger.core.types import CellReading
from logger.drivers.family import Family
from logger.drivers.reading.number_history import NumberHistory
from logger.drivers.reading.recognition import mark_doubtful
from logger.drivers.reading.rows import Registration, Row
from logger.drivers.registry import FAMILIES, reader_of
from logger.drivers.transcript import replies_of

DATA = Path(__file__).resolve().parents[1] / "tests" / "drivers" / "data"
LONGEST = 1500
"""Characters of a reply; longer ones are logs of other things."""
LEVELS = ("rssi_dbm", "rscp_dbm", "rsrp_dbm", "rxlev_raw")
WAYS = ("lost", "doubled", "changed")
POLLS, HIT_EACH = 100, 5
"""Length of a session, less than two minutes of a walk, and how often its line damages a reply."""
HEARD = 2
"""Scans in which a cell must have been heard before it counts."""

Who = tuple[str | None, str | None, int | None, int | None]
Level = tuple[str, float]
NOBODY: Who = (None, None, None, None)


@dataclass(frozen=True, slots=True)
class ReplyContent:
    """What the rows of a reply say: cells for certain, all cells, levels, channels."""

    sure: frozenset[Who]
    named: frozenset[Who]
    levels: frozenset[Level]
    channels: frozenset[int]


@dataclass
class Tally:
    """What was counted of one family."""

    replies: int = 0
    marked_alone: int = 0
    marked_later: int = 0
    trials: Counter[str] = field(default_factory=Counter)
    identities: Counter[str] = field(default_factory=Counter)
    levels: Counter[str] = field(default_factory=Counter)
    channels: Counter[str] = field(default_factory=Counter)
    of_two_scans: Counter[str] = field(default_factory=Counter)
    session: Counter[str] = field(default_factory=Counter)

    def rate(self, counts: Counter[str], *ways: str) -> float:
        """Share of the trials."""
        trials = sum(self.trials[way] for way in ways)
        return sum(counts[way] for way in ways) / trials if trials else 0.0

    def of_session(self, what: str, among: str) -> float:
        """Share of the damaged or the whole replies of the sessions."""
        return self.session[what] / self.session[among] if self.session[among] else 0.0


def replies(corpus: Path | None = None) -> Iterator[tuple[Family, str]]:
    """Replies of the tests' data by family, those of a folder by the family that reads most."""
    for name, driver in FAMILIES.items():
        own = (DATA / "own" / f"{name}.txt").read_text("latin-1").removesuffix("\n")
        yield from ((driver, reply) for reply in own.split("\n\n"))
    files = [*DATA.glob("*.txt"), *(corpus.glob("*.txt") if corpus else ())]
    for path in sorted(files):
        lines = path.read_text("latin-1").splitlines()
        driver = reader_of(lines)
        for reply in replies_of(driver, lines):
            text = "\n".join(reply)
            if text.strip() and len(text) <= LONGEST:
                yield driver, text


def damage_bytes(text: str, way: str, rng: random.Random) -> Iterator[str]:
    """The text with one byte lost, doubled or changed: each in turn."""
    for at, byte in enumerate(text):
        if way == "lost":
            yield text[:at] + text[at + 1 :]
        elif way == "doubled":
            yield text[:at] + byte + text[at:]
        else:
            yield text[:at] + chr(ord(byte) ^ 1 << rng.randrange(7)) + text[at + 1 :]


def read(driver: Family, text: str, known: NumberHistory) -> tuple[tuple[Row, ...], NumberHistory]:
    """Rows of one reply, as a session reads them."""
    return mark_doubtful(driver.read(text.split("\n")), known)


def content_of(rows: Iterable[Row]) -> ReplyContent:
    """What the rows say."""
    naming = [row for row in rows if isinstance(row, CellReading | Registration)]
    cells = [row for row in naming if isinstance(row, CellReading)]
    return ReplyContent(
        frozenset(_who(row) for row in naming if not row.identity_unsure) - {NOBODY},
        frozenset(map(_who, naming)) - {NOBODY},
        frozenset(
            (name, value)
            for row in cells
            for name in LEVELS
            if (value := getattr(row, name)) is not None
        ),
        frozenset(row.arfcn for row in cells if row.arfcn is not None),
    )


def _who(row: CellReading | Registration) -> Who:
    network = (row.mcc, row.mnc) if isinstance(row, CellReading) else (None, None)
    return (*network, row.tac if row.lac is None else row.lac, row.cid)


def is_false(who: Who, honest: Iterable[Who]) -> bool:
    """True for a cell that no row of the whole reply names, not even with more."""
    return not any(all(p in {None, q} for p, q in zip(who, cell, strict=True)) for cell in honest)


def count(
    driver: Family, text: str, tally: Tally, ways: Sequence[str] = WAYS, each: int = 1
) -> None:
    """Count what damage makes of one reply, of every byte or of every so many."""
    rows, known = read(driver, text, NumberHistory())
    honest = content_of(rows)
    if not honest.named and not honest.levels:
        return
    tally.replies += 1
    tally.marked_alone += honest.sure != honest.named
    tally.marked_later += any(
        getattr(row, "identity_unsure", False) for row in read(driver, text, known)[0]
    )
    rng = random.Random(1)
    for way in ways:
        for number, worse in enumerate(damage_bytes(text, way, rng)):
            if number % each == 0:
                tally.trials[way] += 1
                _count_alone(
                    content_of(read(driver, worse, NumberHistory())[0]), honest, way, tally
                )
                tally.of_two_scans[way] += any(
                    is_false(who, honest.named) for who in _sure_cells(driver, text, worse)
                )


def count_session(driver: Family, text: str, tally: Tally, polls: int = POLLS) -> None:
    """Count false and unsure cells of a modem that repeats one reply over a noisy line."""
    honest = content_of(read(driver, text, NumberHistory())[0])
    known, rng = NumberHistory(), random.Random(2)
    if not honest.named:
        return
    for poll in range(polls):
        is_hit = poll % HIT_EACH == HIT_EACH - 1
        way = rng.choice(WAYS[:2])
        reply = list(damage_bytes(text, way, rng))[rng.randrange(len(text))] if is_hit else text
        rows, known = read(driver, reply, known)
        sure = content_of(rows).sure
        tally.session["damaged" if is_hit else "whole"] += 1
        if is_hit:
            tally.session["false"] += any(is_false(who, honest.named) for who in sure)
        else:
            tally.session["marked"] += sure != honest.named


def _count_alone(found: ReplyContent, honest: ReplyContent, way: str, tally: Tally) -> None:
    tally.identities[way] += any(is_false(who, honest.named) for who in found.sure)
    tally.levels[way] += not found.levels <= honest.levels
    tally.channels[way] += not found.channels <= honest.channels


def _sure_cells(driver: Family, text: str, worse: str) -> set[Who]:
    """Cells that two of three scans have named for certain, the damaged one in the middle."""
    known, heard = NumberHistory(), Counter[Who]()
    for reply in (text, worse, text):
        rows, known = read(driver, reply, known)
        heard.update(content_of(rows).sure)
    return {who for who, scans in heard.items() if scans >= HEARD}


def table(tallies: dict[str, Tally]) -> str:
    """The figures as text."""
    titles = (
        "",
        "replies",
        "marked",
        "later",
        "identity",
        "changed",
        "3 scans",
        "level",
        "channel",
        "session",
        "marked",
    )
    units = ("", "", "alone", "", "%", "%", "/1000", "%", "%", "%", "%")
    lines = [
        " ".join([f"{first:12}", *(f"{text:>8}" for text in rest)])
        for first, *rest in (titles, units)
    ]
    for name, tally in {**tallies, "all": _sum(tallies.values())}.items():
        slips = ("lost", "doubled")
        percentages = (
            f"{100 * share:8.2f}"
            for share in (
                tally.rate(tally.identities, *slips),
                tally.rate(tally.identities, "changed"),
                10 * tally.rate(tally.of_two_scans, *WAYS),
                tally.rate(tally.levels, *slips),
                tally.rate(tally.channels, *slips),
                tally.of_session("false", "damaged"),
                tally.of_session("marked", "whole"),
            )
        )
        counts = (tally.replies, tally.marked_alone, tally.marked_later)
        lines.append(" ".join([f"{name:12}", *(f"{count:8}" for count in counts), *percentages]))
    return "\n".join(lines)


def _sum(tallies: Iterable[Tally]) -> Tally:
    whole = Tally()
    for tally in tallies:
        whole.replies += tally.replies
        whole.marked_alone += tally.marked_alone
        whole.marked_later += tally.marked_later
        for name in ("trials", "identities", "levels", "channels", "of_two_scans", "session"):
            getattr(whole, name).update(getattr(tally, name))
    return whole


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description="false identities and values that one damaged byte makes"
    )
    parser.add_argument(
        "--corpus",
        type=Path,
        metavar="FOLDER",
        help="text files of replies, besides the tests' data",
    )
    parser.add_argument(
        "--family", nargs="+", choices=list(FAMILIES), default=list(FAMILIES), metavar="NAME"
    )
    parser.add_argument(
        "--each", type=int, default=1, metavar="N", help="damage every N-th byte only (default 1)"
    )
    arguments = parser.parse_args()
    tallies: dict[str, Tally] = {name: Tally() for name in arguments.family}
    for driver, text in replies(arguments.corpus):
        if driver.name in tallies:
            count(driver, text, tallies[driver.name], each=arguments.each)
            count_session(driver, text, tallies[driver.name])
    print(table(tallies))


if __name__ == "__main__":
    main()
