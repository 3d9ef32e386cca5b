"""How often the rules accuse legitimate cells, and how soon they name a rogue one.

python benchmarks/suspicion.py rates [--logs FOLDER] [--cities N] [--python]
python benchmarks/suspicion.py stations [--logs FOLDER] [--cities N] [--every N]
python benchmarks/suspicion.py walks --walks N [--logs FOLDER] [--every N]
python benchmarks/suspicion.py takeovers
python benchmarks/suspicion.py gone --cities N
python benchmarks/suspicion.py live

`rates` applies all rules to legitimate logs (../shared/cells; CELLWALK_CELLS names another folder)
and to simulated clean cities. One alarm is one cell in one run. It prints alarms, hours, rates with
95 % Poisson intervals, and alarms per 100 cells, by set and technology; `--python` prints what the
rules of `logger/core/suspicion` declare. `stations` puts one rogue station into each run, for good
or for 60 s, and prints what each threshold of the score, each rule and a database is worth. `walks`
puts the ordinary catcher into runs with N earlier walks. `takeovers` takes over a channel beside a
standing receiver. `gone` takes cells off the air in simulated cities that were walked before (rule
B3). `live` compares the cost of the rules on the walk with that of the locator, for 40 cells.
"""

import argparse
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from io import TextIOWrapper
from itertools import islice
from pathlib import Path
from statistics import median
from typing import NamedTuple, TypeVar

from benchmarks.suspicion_baseline import logs_with_baseline
from benchmarks.suspicion_city import city_logs
from benchmarks.suspicion_gone import gone_walks, print_gone
from benchmarks.suspicion_injection import Outcome, Station, outcomes
from benchmarks.suspicion_live import print_live_cost
from benchmarks.suspicion_logs import LOGS, Log, cells_with_one_peak, read_logs
from benchmarks.suspicion_patterns import COPIES, KINDS, ORDINARY
from benchmarks.suspicion_takeover import full_scans, print_takeovers, takeovers
from benchmarks.synthetic_city.loggers import wilson95
from logger.core import answer
from logger.core.baseline import NO_BASELINE, Baseline
from logger.core.suspicion.rule import WORDS, Finding, Rate
from logger.core.suspicion.rules import RULES
from logger.core.suspicion.tracker import SuspicionTracker
from logger.core.suspicion.words import assess
from logger.core.types import Scan
from postproc.suspicion.run_assessment import DATABASE_RULES

GROUPS = {
    "driving": ("cork_driving", "india_gsm", "india_umts", "ottawa"),
    "standing": ("cork_static",),
    "city": ("simulated",),
}
"""Sets of logs by how the receiver moved: while it stands, nothing else changes the levels."""
NOT_RATED = frozenset({"simulated", "losangeles"})
"""Sets that the declared rates are not of: cells of losangeles have no identity but channel and
code, for which no rule is asked on a walk. Here these are taken for one; of what is heard there,
cells with one peak count, since codes are used again."""
MOST_CITIES = 8
ON_AIR_S = 60.0
STATIONS = [Station(kind, is_strong) for kind in KINDS for is_strong in (True, False)]
BRIEF = [Station(kind, True, ON_AIR_S) for kind in ("invented identity", "new area", "downgrade")]
CATCHERS = [station for station in STATIONS if station.kind == ORDINARY]
FALSE_AN_HOUR = (0.03, 0.1, 0.3, 1.0)
Run = TypeVar("Run")
DATABASES = (60, 90)
"""Cells of each 100 that a database has."""


@dataclass(slots=True)
class Counts:
    """Alarms and cells by rule or word, set and technology; hours by set.

    `exposed` counts the cells that a rule was applied to, `exposed_hours` those of their logs.
    """

    alarms: Counter[tuple[str, str, str]] = field(default_factory=Counter)
    exposed: Counter[tuple[str, str, str]] = field(default_factory=Counter)
    exposed_hours: Counter[tuple[str, str, str]] = field(default_factory=Counter)
    words: Counter[tuple[str, str]] = field(default_factory=Counter)
    cells: Counter[str] = field(default_factory=Counter)
    hours: Counter[str] = field(default_factory=Counter)
    suspicious: list[str] = field(default_factory=list)
    assessed: list[tuple[str, answer.Word]] = field(default_factory=list)

    def add(self, log: Log, baseline: Baseline = NO_BASELINE) -> None:
        """Apply all rules to a run."""
        tracker = SuspicionTracker(baseline=baseline)
        rats: dict[str, str] = {}
        asked: set[tuple[str, str, str]] = set()
        is_by_channel = log.set_name == "losangeles"
        log = log.by_channel if is_by_channel else log
        counted = cells_with_one_peak(log) if is_by_channel else None
        for record in log.records:
            tracker.feed(record)
            if isinstance(record.value, Scan):
                rats |= {r.cell: r.rat for r in record.value.readings if r.cell and r.rat}
        self.hours[log.set_name] += log.hours  # type: ignore[assignment]
        for cell in tracker.assessments():
            if counted is not None and cell.cell not in counted:
                continue
            rat = rats.get(cell.cell, "")  # of a cell that is gone there is no reading
            self.assessed.append((log.set_name, cell))
            self.cells[log.set_name] += 1
            self.words[cell.word, log.set_name] += 1
            for finding in cell.findings:
                self.alarms[finding.rule.id, log.set_name, rat] += 1
            for rule in RULES.values():
                if tracker.capabilities.is_asked(rule, rat):
                    self.exposed[rule.id, log.set_name, rat] += 1
                    asked.add((rule.id, log.set_name, rat))
            if cell.word == "suspicious":
                rules = " ".join(finding.rule.id for finding in cell.findings)
                self.suspicious.append(f"{log.name}: {cell.cell} ({rules})")
        for key in asked:
            self.exposed_hours[key] += log.hours  # type: ignore[assignment]


def count(logs: Iterable[Log]) -> Counts:
    """Counts over runs."""
    counts, runs = Counts(), list(logs)
    for log in _in_turn(runs, len(runs), "all rules"):
        counts.add(log)
    return counts


def _in_turn(runs: Iterable[Run], n: int, what: str) -> Iterator[Run]:
    """Runs with a line of progress for each tenth of them."""
    for k, run in enumerate(runs):
        if k * 10 // n != (k - 1) * 10 // n:
            print(f"{what}: run {k + 1} of {n}", file=sys.stderr, flush=True)
        yield run


def print_rates(counts: Counts) -> None:
    """Tables of the words by set, and of the rules by set and technology."""
    print_words(counts)
    print("\nrule  set            technology  alarms  cells   hours  per hour (95 %)")
    for rule in RULES:
        for (_, name, rat), cells in sorted(counts.exposed.items()):
            if _ == rule:
                n = counts.alarms[rule, name, rat]
                hours = counts.hours[name]
                low, high = (x / hours for x in Rate(n, cells, hours, "").interval)
                interval = f"{n / hours:.2f} ({low:.2f} to {high:.2f})"
                print(f"{rule:4}  {name:13}  {rat:10}  {n:6}  {cells:5}  {hours:6.1f}  {interval}")
        if not any(key[0] == rule for key in counts.exposed):
            print(f"{rule:4}  rate not measured here: {', '.join(sorted(RULES[rule].needs))}")


def print_words(counts: Counts) -> None:
    """The words by set, and the cells that are suspicious."""
    print("word              set            alarms  hours  per hour (95 %)         per 100 cells")
    for word in WORDS[:0:-1]:
        for name in [*sorted(counts.hours), "logs"]:
            sets = _sets(counts, name)
            n = sum(counts.words[word, one] for one in sets)
            _print_row(word, name, n, counts, sets)
    for text in counts.suspicious:
        print(f"suspicious: {text}")


def _sets(counts: Counts, name: str) -> list[str]:
    return [one for one in counts.hours if one not in NOT_RATED] if name == "logs" else [name]


def _print_row(word: str, name: str, n: int, counts: Counts, sets: Sequence[str]) -> None:
    hours, cells = sum(counts.hours[s] for s in sets), sum(counts.cells[s] for s in sets)
    if not hours or not cells:
        return
    low, high = (x / hours for x in Rate(n, cells, hours, "").interval)
    rate = f"{n / hours:.2f} ({low:.2f} to {high:.2f})"
    print(f"{word:16}  {name:13}  {n:6}  {hours:5.1f}  {rate:22}  {100.0 * n / cells:.2f}")


def print_python(counts: Counts) -> None:
    """What the rules declare as `measured`, and the words as `WORD_RATES`, from the logs alone."""
    sets = _sets(counts, "logs")
    for rule in RULES:
        rats = sorted({rat for name, one, rat in counts.exposed if name == rule and one in sets})
        rates = [f"{rat}=({', '.join(_rate_of(counts, rule, rat))})" for rat in rats]
        if rates:
            print(f"{rule}: measured=on_telephones({', '.join(rates)}),")
    hours, cells = sum(counts.hours[s] for s in sets), sum(counts.cells[s] for s in sets)
    for word in WORDS[:0:-1]:
        n = sum(counts.words[word, s] for s in sets)
        print(f'"{word}": Rate({n}, {cells}, {hours:.1f}, _LOGS),')


def _rate_of(counts: Counts, rule: str, rat: str) -> tuple[str, str, str]:
    """Alarms, cells and hours of a rule and a technology."""
    keys = [(rule, one, rat) for one in _sets(counts, "logs")]
    alarms, cells = (sum(of[key] for key in keys) for of in (counts.alarms, counts.exposed))
    return str(alarms), str(cells), f"{sum(counts.exposed_hours[key] for key in keys):.1f}"


def print_detection(station: Station, outcomes_of_all: Sequence[Outcome]) -> None:
    """A line for each kind of log, and for clones one of the runs that passed both stations."""
    power = "strong" if station.is_strong else "weak"
    results = [one for one in outcomes_of_all if one.station == station]
    for group, sets in GROUPS.items():
        _print_share(station.kind, power, group, [one for one in results if one.set_name in sets])
    if station.kind in COPIES:
        _print_share(station.kind, power, "both passed", [one for one in results if one.is_passed])


def _print_share(kind: str, power: str, group: str, results: Sequence[Outcome]) -> None:
    """Shares of runs with the word, and the medians of seconds and metres until it."""
    n = len(results)
    if not n:
        return
    in_time = sum(one.in_time == "suspicious" for one in results) / n
    at_end = sum(one.at_end.word == "suspicious" for one in results) / n
    unusual = sum(one.at_end.is_conspicuous for one in results) / n
    seconds = [one.seconds for one in results if one.seconds is not None]
    metres = [one.metres for one in results if one.metres is not None]
    until = f"{median(seconds):5.0f} s  {median(metres):5.0f} m" if seconds else "-"
    print(
        f"{kind:24}  {power:6}  {group:11}  {n:4}  {in_time:7.2f}  {at_end:6.2f}  "
        f"{unusual:7.2f}  {until}"
    )


def print_stations(logs: Sequence[Log], every: int) -> None:
    """Detection."""
    measured = [log for log in logs if log.set_name not in NOT_RATED][::every]
    cities = [log for log in logs if log.set_name == "simulated"][:MOST_CITIES:every]
    rated = [*measured, *cities]
    in_turn = _in_turn(rated, len(rated), "stations")
    found = [one for log in in_turn for one in outcomes(log, NO_BASELINE, [*STATIONS, *BRIEF])]
    print(_HEAD)
    for station in STATIONS:
        print_detection(station, found)
    print(f"on the air for {ON_AIR_S:.0f} s")
    for station in BRIEF:
        print_detection(station, found)
    results = [one for one in found if one.station in STATIONS and one.set_name != "simulated"]
    counts = count(measured)
    print_worth(counts, results)
    print_databases(counts, results)


def print_walks(folder: Path, n_walks: int, every: int) -> None:
    """Words and detection with earlier walks."""
    earlier, found = Counts(), []
    for log, baseline in islice(logs_with_baseline(folder, n_walks), None, None, every):
        print(f"{n_walks} earlier walks: {log.name}", file=sys.stderr, flush=True)
        earlier.add(log, baseline)
        found += outcomes(log, baseline, CATCHERS)
    print(f"with {n_walks} earlier walks of the route")
    print_words(earlier)
    print(_HEAD)
    for station in CATCHERS:
        print_detection(station, found)
    print_databases(earlier, found)


def print_worth(counts: Counts, results: Sequence[Outcome]) -> None:
    """Shares of stations above thresholds of the score, and words without each rule."""
    clean = [cell for name, cell in counts.assessed if name in _sets(counts, "logs")]
    hours = sum(counts.hours[name] for name in _sets(counts, "logs"))
    scores = sorted((cell.score_nats for cell in clean), reverse=True)
    limits = [scores[int(an_hour * hours)] for an_hour in FALSE_AN_HOUR]
    print("\nstations above the score that so many legitimate cells an hour exceed, 95 % intervals")
    rates = [Rate(int(an_hour * hours), len(clean), hours, "") for an_hour in FALSE_AN_HOUR]
    alarms = [[n / hours for n in (rate.alarms, *rate.interval)] for rate in rates]
    print(f"{'':32}" + "".join(_COLUMN.format(*each) for each in alarms))
    print(f"{'nats':32}" + "".join(f"{limit:22.2f}" for limit in limits))
    for station in sorted({one.station for one in results}):
        of = [one.at_end.score_nats for one in results if one.station == station]
        above = [sum(score > limit for score in of) for limit in limits]
        shares = [(n / len(of), *wilson95(n, len(of))) for n in above]
        name = f"{station.kind}, {'strong' if station.is_strong else 'weak'}"
        print(f"{name:32}" + "".join(_COLUMN.format(*each) for each in shares))
    print("\nsuspicious and unusual without a rule: stations, legitimate cells")
    stations = [one.at_end for one in results]
    for rule in (None, *RULES):
        words = [_words_without(rule, cells) for cells in (stations, clean)]
        if rule is None:
            usual = words
        if rule is None or words != usual:
            print(f"{rule or 'all':4}  {words[0]}  {words[1]}")


class _Desk(NamedTuple):
    """What rule P3 weighs."""

    known: range
    names: range


def print_databases(counts: Counts, results: Sequence[Outcome]) -> None:
    """The ordinary catcher, and what legitimate cells expect."""
    clean = [cell for name, cell in counts.assessed if name in _sets(counts, "logs")]
    hours = sum(counts.hours[name] for name in _sets(counts, "logs"))
    for n_known in DATABASES:
        print(f"\nwith a database of {n_known} of 100 cells")
        missing = [_words(without_entry(cell, n_known) for cell in clean), _words(clean)]
        share = 1.0 - n_known / 100.0
        for word, absent, there in zip(WORDS[:0:-1], *missing, strict=True):
            n = share * absent + (1.0 - share) * there
            print(f"{word}: {n:.2f} legitimate cells expected, {n / hours:.3f} an hour")
        weighed = [replace(one, at_end=without_entry(one.at_end, n_known)) for one in results]
        for station in CATCHERS:
            print_detection(station, weighed)


def without_entry(cell: answer.Word, n_known: int) -> answer.Word:
    """The word of a missing cell."""
    rule = DATABASE_RULES[0]
    assert rule.weigh is not None
    nats = rule.weigh(_Desk(range(n_known), range(100)), cell)
    finding = Finding(rule, cell.cell, 0, None, None, "", {}, nats)
    return assess(cell.cell, [*cell.findings, finding])


def _words(cells: Iterable[answer.Word]) -> tuple[int, int]:
    """Numbers of suspicious and of unusual cells."""
    words = Counter(cell.word for cell in cells)
    return words["suspicious"], words["unusual"]


def _words_without(rule: str | None, cells: Sequence[answer.Word]) -> tuple[int, int]:
    return _words(
        assess(cell.cell, [one for one in cell.findings if one.rule.id != rule]) for cell in cells
    )


_COLUMN = "  {:.2f} ({:.2f} to {:.2f})"
_HEAD = (
    "\nstation                   power   receiver     runs  in time  at end  unusual  until named"
)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run one of the benchmarks."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("what", choices=["rates", "stations", "walks", "takeovers", "gone", "live"])
    parser.add_argument("--logs", type=Path, default=LOGS, help="folder of the logs")
    parser.add_argument("--walks", type=int, default=10, help="earlier walks of the route")
    parser.add_argument("--cities", type=int, default=0, help="simulated clean cities")
    parser.add_argument("--every", type=int, default=1, help="quick: each N-th run only")
    parser.add_argument("--python", action="store_true", help="print it as the rules declare it")
    given = parser.parse_args(arguments)
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(line_buffering=True)  # tables at once, into a file too
    if given.what == "live":
        print_live_cost()
        return
    if given.what == "gone":
        print_gone(list(gone_walks(given.cities)))
        return
    if given.what == "takeovers":
        print_takeovers(list(takeovers(full_scans())))
        return
    if given.what == "walks":
        print_walks(given.logs, given.walks, given.every)
        return
    logs = [*read_logs(given.logs), *city_logs(given.cities)]
    if not logs:
        raise SystemExit(f"there are no logs (*.csv.gz) in {given.logs}")
    if given.what == "stations":
        print_stations(logs, given.every)
        return
    counts = count(logs[:: given.every])
    (print_python if given.python else print_rates)(counts)


if __name__ == "__main__":
    main()
