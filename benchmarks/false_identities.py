"""False identities and values that damaged bytes make, for each family of modems.

python benchmarks/false_identities.py [--corpus FOLDER] [--family NAME ...]
python benchmarks/false_identities.py --streams 5000 [--whole SHARE] [--seed N] [--strangers]

Every byte of the replies in the tests' data and in FOLDER is lost, doubled and changed in turn. A
row is false where it names a cell, a level or a channel that the reply does not, unless its
identity is marked unsure. Replies come alone; then each damaged one comes between two whole ones,
and only a cell that two scans have heard counts. Whole replies with an unsure identity are counted
too: alone, and after an earlier reply. At last each reply comes a hundred times, every fifth with a
byte lost or doubled: `session`.

With `--streams` a modem sends so many damaged replies of each kind of `DAMAGES` in one session,
reply and place drawn; `--whole` is the share that comes whole, by default none. An identity is
believed where two replies have named it for certain. With `--strangers` every other driver reads
the stream as well and may invent no cell.
"""

import argparse
import random
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path

from logger.core.cell_names import FEWEST_SCANS
from logger.core.types import CellReading
from logger.drivers.family import Family
from logger.drivers.generic import Generic
from logger.drivers.reading.recognition import NumberHistory, mark_doubtful
from logger.drivers.reading.row_language import Registration, Row
from logger.drivers.reading.standard_replies import with_serving_cell
from logger.drivers.registry import FAMILIES, reader_of
from logger.drivers.transcript import replies_of

DATA = Path(__file__).resolve().parents[1] / "tests" / "drivers" / "data"
LONGEST = 1500
"""Characters of a reply; longer ones are logs of other things."""
LEVELS = ("rssi_dbm", "rscp_dbm", "rsrp_dbm", "rxlev_raw")
WAYS = ("lost", "doubled", "changed")
POLLS, HIT_EACH = 100, 5
"""Length of a session, less than two minutes of a walk, and how often its line damages a reply."""

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


def _flip(text: str, at: int, rng: random.Random) -> str:
    return text[:at] + chr(ord(text[at]) ^ 1 << rng.randrange(8)) + text[at + 1 :]


def _swap(text: str, at: int, _: random.Random) -> str:
    return text[:at] + text[at : at + 2][::-1] + text[at + 2 :]


def _lose(text: str, at: int, _: random.Random) -> str:
    return text[:at] + text[at + 1 :]


def _double(text: str, at: int, _: random.Random) -> str:
    return text[:at] + text[at] + text[at:]


def _cut(text: str, at: int, _: random.Random) -> str:
    end = (text + "\n").index("\n", at)
    return text[:at] + text[end:]


def _merge(text: str, at: int, _: random.Random) -> str:
    """Without the line end behind `at`, or the last one before it."""
    end = text.find("\n", at)
    end = text.rfind("\n") if end < 0 else end
    return text if end < 0 else text[:end] + text[end + 1 :]


def _insert(text: str, at: int, rng: random.Random) -> str:
    return text[:at] + chr(rng.randrange(256)) + text[at:]


def _burst(text: str, at: int, rng: random.Random) -> str:
    """Two to six bytes replaced: a half by any byte, a half by printable ones, which look true."""
    length = rng.randrange(2, 7)
    alphabet = rng.choice((range(256), range(48, 58)))
    noise = "".join(chr(rng.choice(alphabet)) for _ in text[at : at + length])
    return text[:at] + noise + text[at + length :]


DAMAGES: Mapping[str, Callable[[str, int, random.Random], str]] = {
    "flip": _flip,
    "swap": _swap,
    "lost": _lose,
    "doubled": _double,
    "cut": _cut,
    "merged": _merge,
    "inserted": _insert,
    "burst": _burst,
}
"""What a line does to a reply at a place: a flipped bit, two bytes exchanged, a byte lost, doubled
or inserted, a row cut, two rows merged, several bytes replaced."""


@dataclass
class Stream:
    """What came of the damaged replies of one kind."""

    damaged: int = 0
    false: int = 0
    sure: int = 0
    believed: set[Who] = field(default_factory=set)

    def add(self, other: "Stream") -> None:
        """Count another stream too."""
        self.damaged += other.damaged
        self.false += other.false
        self.sure += other.sure
        self.believed |= other.believed

    @property
    def cells(self) -> set[Who]:
        """Those that have a name."""
        return {who for who in self.believed if None not in who}


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


def poll(driver: Family, text: str, known: NumberHistory) -> tuple[tuple[Row, ...], NumberHistory]:
    """The same, with the serving cell that a poll of any modem puts together."""
    rows = driver.read(text.split("\n"))
    return mark_doubtful(with_serving_cell(rows) if driver.name == Generic.name else rows, known)


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


def stream(
    driver: Family,
    texts: Sequence[str],
    kind: str,
    n_damaged: int,
    *,
    whole: float = 0.0,
    seed: int = 1,
    reader: Family | None = None,
) -> Stream:
    """Count the false cells of a session with so many damaged replies of one kind."""
    rng = random.Random(f"{seed} {driver.name} {kind}")
    truth = content_of(
        row for text in texts for row in poll(driver, text, NumberHistory())[0]
    ).named
    found, known, heard = Stream(), NumberHistory(), Counter[Who]()
    while found.damaged < n_damaged:
        text = rng.choice(texts)
        if rng.random() >= whole:
            found.damaged += 1
            text = DAMAGES[kind](text, rng.randrange(len(text)), rng)
        rows, known = poll(reader or driver, text, known)
        content = content_of(rows)
        found.false += any(is_false(who, truth) for who in content.named)
        wrong = {who for who in content.sure if is_false(who, truth)}
        found.sure += bool(wrong)
        heard.update(wrong)
    found.believed = {who for who, scans in heard.items() if scans >= FEWEST_SCANS}
    return found


def stream_table(streams: Mapping[str, Mapping[str, Stream]]) -> str:
    """For each family and kind: false in one reply, sure in one reply, identities believed."""
    lines = [" ".join([f"{'':12}", *(f"{kind:>16}" for kind in DAMAGES)])]
    total: dict[str, Stream] = {kind: Stream() for kind in DAMAGES}
    for name, kinds in streams.items():
        for kind, found in kinds.items():
            total[kind].add(found)
        lines.append(_stream_line(name, kinds))
    return "\n".join([*lines, _stream_line("all", total)])


def _stream_line(name: str, kinds: Mapping[str, Stream]) -> str:
    cells = (
        f"{found.false}/{found.sure}/{len(found.believed)}/{len(found.cells)}"
        for found in kinds.values()
    )
    return " ".join([f"{name:12}", *(f"{cell:>16}" for cell in cells)])


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
    return {who for who, scans in heard.items() if scans >= FEWEST_SCANS}


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
    parser.add_argument(
        "--streams", type=int, metavar="N", help="damaged replies of each kind, in one session"
    )
    parser.add_argument("--whole", type=float, default=0.0, metavar="SHARE")
    parser.add_argument("--seed", type=int, default=1, metavar="N")
    parser.add_argument("--strangers", action="store_true", help="let other drivers read as well")
    arguments = parser.parse_args()
    if arguments.streams:
        _print_streams(arguments)
        return
    tallies: dict[str, Tally] = {name: Tally() for name in arguments.family}
    for driver, text in replies(arguments.corpus):
        if driver.name in tallies:
            count(driver, text, tallies[driver.name], each=arguments.each)
            count_session(driver, text, tallies[driver.name])
    print(table(tallies))


def _print_streams(arguments: argparse.Namespace) -> None:
    """Print the table of `--streams`."""
    texts: dict[str, list[str]] = {}
    for driver, text in replies(arguments.corpus):
        named = content_of(read(driver, text, NumberHistory())[0]).named
        if any(None not in who[2:] for who in named):
            texts.setdefault(driver.name, []).append(text)
    streams: dict[str, dict[str, Stream]] = {}
    for name in arguments.family:
        readers = [other for other in FAMILIES.values() if other.name != name]
        readers = readers if arguments.strangers else [FAMILIES[name]]
        of_kind = streams[name] = {kind: Stream() for kind in DAMAGES}
        for kind, reader in product(DAMAGES, readers):
            of_kind[kind].add(
                stream(
                    FAMILIES[name],
                    texts[name],
                    kind,
                    arguments.streams // len(readers),
                    whole=arguments.whole,
                    seed=arguments.seed,
                    reader=reader,
                )
            )
    n_damaged = {found.damaged for kinds in streams.values() for found in kinds.values()}
    print(
        f"{max(n_damaged)} damaged replies of each kind and family, seed {arguments.seed}, "
        f"{arguments.whole:.0%} whole in between;\n"
        "replies with a false identity / with a false one that is sure / false identities, or parts"
        " of one, that two replies named / complete ones among them, which are believed"
    )
    print(stream_table(streams))


if __name__ == "__main__":
    main()
