"""How often the rules accuse legitimate cells, and how soon they name a rogue one.

python benchmarks/suspicion.py rates [--logs FOLDER] [--cities N] [--python]
python benchmarks/suspicion.py rates --baseline 7 [--logs FOLDER]
python benchmarks/suspicion.py detection [--logs FOLDER] [--seeds N]
python benchmarks/suspicion.py gone --cities N
python benchmarks/suspicion.py live

`rates` applies all rules to legitimate logs (../shared/cells; CELLWALK_CELLS names another folder)
and to simulated clean cities. One alarm is one cell in one run. It prints alarms, hours, rates with
95 % Poisson intervals, and alarms per 100 cells, by set and technology; `--python` prints the
tables of `logger/core/suspicion/rates.py`. `detection` puts one rogue station into each run. `gone`
takes cells off the air in simulated cities that were walked before (rule B3). `live` compares the
cost of the rules on the walk with that of the locator, for 40 cells.
"""

import argparse
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median

from scipy.stats import chi2

from benchmarks.suspicion_baseline import logs_with_baseline
from benchmarks.suspicion_city import city_logs
from benchmarks.suspicion_gone import gone_walks, print_gone
from benchmarks.suspicion_injection import Outcome, outcomes
from benchmarks.suspicion_live import print_live_cost
from benchmarks.suspicion_logs import LOGS, Log, read_logs
from benchmarks.suspicion_patterns import COPIES, KINDS
from logger.core.baseline import Baseline
from logger.core.suspicion.finding import WORDS
from logger.core.suspicion.rules import RULES
from logger.core.suspicion.tracker import SuspicionTracker

GROUPS = {
    "driving": ("cork_driving", "india_gsm", "india_umts", "ottawa"),
    "standing": ("cork_static",),
    "city": ("simulated",),
}
"""Sets of logs by how the receiver moved: while it stands, nothing else changes the levels."""


@dataclass(slots=True)
class Counts:
    """Alarms and cells by rule or word, set and technology; hours by set.

    `exposed` counts the cells that a rule was applied to.
    """

    alarms: Counter[tuple[str, str, str]] = field(default_factory=Counter)
    exposed: Counter[tuple[str, str, str]] = field(default_factory=Counter)
    words: Counter[tuple[str, str]] = field(default_factory=Counter)
    cells: Counter[str] = field(default_factory=Counter)
    hours: Counter[str] = field(default_factory=Counter)
    suspicious: list[str] = field(default_factory=list)

    def add(self, log: Log, baseline: Baseline | None = None) -> None:
        """Apply all rules to a run."""
        tracker = SuspicionTracker(baseline=baseline)
        rats: dict[str, str] = {}
        for record in log.records:
            tracker.feed(record)
            rats |= tracker.technologies()
        self.hours[log.set_name] += log.hours  # type: ignore[assignment]
        for cell in tracker.assessments():
            rat = rats[cell.cell]
            self.cells[log.set_name] += 1
            self.words[cell.word, log.set_name] += 1
            for finding in cell.findings:
                self.alarms[finding.rule, log.set_name, rat] += 1
            for rule in RULES.values():
                if tracker.capabilities.is_asked(rule, rat):
                    self.exposed[rule.id, log.set_name, rat] += 1
            if cell.word == "suspicious":
                rules = " ".join(finding.rule for finding in cell.findings)
                self.suspicious.append(f"{log.name}: {cell.cell} ({rules})")


def poisson95(alarms: int) -> tuple[float, float]:
    """95 % interval of the mean of a Poisson count; that of 0 is one-sided (3.0)."""
    if alarms == 0:
        return 0.0, float(chi2.ppf(0.95, 2) / 2.0)
    return (
        float(chi2.ppf(0.025, 2 * alarms) / 2.0),
        float(chi2.ppf(0.975, 2 * alarms + 2) / 2.0),
    )


def count(logs: Iterable[Log]) -> Counts:
    """Counts over runs."""
    counts = Counts()
    for log in logs:
        counts.add(log)
    return counts


def print_rates(counts: Counts) -> None:
    """Tables of the words by set, and of the rules by set and technology."""
    print("word              set            alarms  hours  per hour (95 %)         per 100 cells")
    for word in WORDS[:0:-1]:
        for name in [*sorted(counts.hours), "logs"]:
            sets = _sets(counts, name)
            n = sum(counts.words[word, one] for one in sets)
            _print_row(word, name, n, counts, sets)
    print("\nrule  set            technology  alarms  cells   hours  per hour (95 %)")
    for rule in RULES:
        for (_, name, rat), cells in sorted(counts.exposed.items()):
            if _ == rule:
                n = counts.alarms[rule, name, rat]
                hours = counts.hours[name]
                low, high = (x / hours for x in poisson95(n))
                interval = f"{n / hours:.2f} ({low:.2f} to {high:.2f})"
                print(f"{rule:4}  {name:13}  {rat:10}  {n:6}  {cells:5}  {hours:6.1f}  {interval}")
        if not any(key[0] == rule for key in counts.exposed):
            print(f"{rule:4}  rate not measured here: {', '.join(sorted(RULES[rule].needs))}")
    for text in counts.suspicious:
        print(f"suspicious: {text}")


def _sets(counts: Counts, name: str) -> list[str]:
    return [one for one in counts.hours if one != "simulated"] if name == "logs" else [name]


def _print_row(word: str, name: str, n: int, counts: Counts, sets: Sequence[str]) -> None:
    hours, cells = sum(counts.hours[s] for s in sets), sum(counts.cells[s] for s in sets)
    if not hours:
        return
    low, high = (x / hours for x in poisson95(n))
    rate = f"{n / hours:.2f} ({low:.2f} to {high:.2f})"
    print(f"{word:16}  {name:13}  {n:6}  {hours:5.1f}  {rate:22}  {100.0 * n / cells:.2f}")


def print_python(counts: Counts) -> None:
    """The tables of `rates.py`, from the logs alone."""
    print("MEASURED: Mapping[str, Mapping[str, Rate]] = {")
    for rule in RULES:
        rats: dict[str, list[int]] = {}
        for (name, set_name, rat), cells in counts.exposed.items():
            if name == rule and set_name != "simulated":
                sums = rats.setdefault(rat, [0, 0])
                sums[0] += counts.alarms[rule, set_name, rat]
                sums[1] += cells
        rates = ", ".join(f'"{r}": Rate({a}, {n}, _LOGS)' for r, (a, n) in sorted(rats.items()))
        if rates:
            print(f'    "{rule}": {{{rates}}},')
    print("}\n\nWORD_RATES: Mapping[Word, HourRate] = {")
    sets = _sets(counts, "logs")
    hours = sum(counts.hours[s] for s in sets)
    for word in WORDS[:0:-1]:
        n = sum(counts.words[word, s] for s in sets)
        print(f'    "{word}": HourRate({n}, {hours:.1f}),')
    print("}")


def print_detection(kind: str, strong: bool, results: Sequence[Outcome]) -> None:
    """A line for each kind of log, and for clones one of the runs that passed both stations."""
    power = "strong" if strong else "weak"
    for group, sets in GROUPS.items():
        _print_share(kind, power, group, [one for one in results if one.set_name in sets])
    if kind in COPIES:
        _print_share(kind, power, "both passed", [one for one in results if one.is_passed])


def _print_share(kind: str, power: str, group: str, results: Sequence[Outcome]) -> None:
    """Shares of runs with the word, and the medians of seconds and metres until it."""
    n = len(results)
    if not n:
        return
    in_time = sum(one.in_time == "suspicious" for one in results) / n
    at_end = sum(one.at_end == "suspicious" for one in results) / n
    unusual = sum(one.at_end != "nothing unusual" for one in results) / n
    seconds = [one.seconds for one in results if one.seconds is not None]
    metres = [one.metres for one in results if one.metres is not None]
    until = f"{median(seconds):5.0f} s  {median(metres):5.0f} m" if seconds else "-"
    print(
        f"{kind:24}  {power:6}  {group:11}  {n:4}  {in_time:7.2f}  {at_end:6.2f}  "
        f"{unusual:7.2f}  {until}"
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Run one of the benchmarks."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("what", choices=["rates", "detection", "gone", "live"])
    parser.add_argument("--logs", type=Path, default=LOGS, help="folder of the logs")
    parser.add_argument("--cities", type=int, default=0, help="simulated clean cities")
    parser.add_argument("--seeds", type=int, default=1, help="stations for each run and kind")
    parser.add_argument("--baseline", type=int, default=0, help="earlier walks of the same route")
    parser.add_argument("--python", action="store_true", help="print rates.py")
    given = parser.parse_args(arguments)
    if given.what == "live":
        print_live_cost()
        return
    if given.what == "gone":
        print_gone(list(gone_walks(given.cities)))
        return
    if given.baseline:
        counts = Counts()
        for log, baseline in logs_with_baseline(given.logs, given.baseline):
            counts.add(log, baseline)
        print_rates(counts)
        return
    logs = [*read_logs(given.logs), *city_logs(given.cities)]
    if not logs:
        raise SystemExit(f"there are no logs (*.csv.gz) in {given.logs}")
    if given.what == "rates":
        counts = count(logs)
        (print_python if given.python else print_rates)(counts)
        return
    print(
        "station                   power   receiver     runs  in time  at end  unusual  until named"
    )
    for kind in KINDS:
        for strong in (True, False):
            print_detection(kind, strong, list(outcomes(logs, kind, strong, given.seeds)))


if __name__ == "__main__":
    main()
