"""What a rule is, what it finds, and how often it is wrong."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from math import exp, isclose, log
from typing import Any, Generic, Literal, TypeVar

from logger.core.certainty import metres
from logger.core.suspicion.heard import HeardCell, Memory, cells_of_scan

Word = Literal["nothing unusual", "unusual", "suspicious"]
WORDS: tuple[Word, ...] = ("nothing unusual", "unusual", "suspicious")

Family = Literal[
    "plan", "area", "neighbours", "signal", "place", "timing", "broadcast", "technology",
    "earlier walks",
]  # fmt: skip
Need = Literal[
    "position", "country code", "identity", "area code", "channel", "colour code", "level",
    "neighbours", "neighbour lists", "timing advance", "C1 and C2",
    "second technology", "other cells", "earlier walks", "cell database",
]  # fmt: skip
Value = float | int | str
Evidence = Mapping[str, Value]

GSM = frozenset({"GSM"})
ALL = frozenset({"GSM", "WCDMA", "LTE", "LTE-M", "NB-IoT", "NR"})

_FEWEST_MEASURED = 100
"""Cells from which on a technology has its own rate: below, other logs say more than 3/n."""
_FEWEST_ALARMS = 3
"""Alarms that show a rate by themselves."""


@dataclass(frozen=True, slots=True)
class Rate:
    """Legitimate cells that earned an alarm, of how many, in how many hours, and in which logs.

    `hours` is 0 for scans without a duration.
    """

    alarms: int
    cells: int
    hours: float
    where: str

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the mean number of alarms (Poisson); of 0 it is one-sided."""
        if not self.alarms:
            return 0.0, _mean_with(0, 0.05)
        return _mean_with(self.alarms - 1, 0.975), _mean_with(self.alarms, 0.025)

    @property
    def per_cell(self) -> float:
        """Share of cells; its upper bound if there was no alarm."""
        return min((self.alarms or _NONE_SEEN) / self.cells, 1.0)

    @property
    def per_hour(self) -> float:
        """Alarms an hour; the upper bound if there was none."""
        return (self.alarms or _NONE_SEEN) / self.hours

    @property
    def text(self) -> str:
        """It in words, without the logs."""
        of = f"{self.alarms} of {self.cells} cells"
        if self.hours:
            low, high = (alarms / self.hours for alarms in self.interval)
            of = f"{of} in {self.hours:.1f} h ({low:.2f} to {high:.2f} an hour)"
        return of


_NONE_SEEN = 3.0
"""Without an alarm among n cells, the rate is below 3/n with 95 % probability."""


def _mean_with(alarms: int, probability: float) -> float:
    """Mean with which so many alarms or fewer are that probable."""
    low, high = 0.0, 2.0 * alarms + 20.0
    for _ in range(60):
        mean = 0.5 * (low + high)
        term = share = exp(-mean)
        for k in range(1, alarms + 1):
            term *= mean / k
            share += term
        low, high = (mean, high) if share > probability else (low, mean)
    return 0.5 * (low + high)


def on_telephones(**by_rat: tuple[int, int, float]) -> Mapping[str, Rate]:
    """Alarms, cells and hours by technology, as `benchmarks/suspicion.py rates --python` prints.

    62 runs, 38.5 h, mostly in cars: GSM 2 h in calls, UMTS, LTE. Upper bounds for a modem on foot.
    """
    where = "62 runs of telephones, mostly in cars"
    return {rat: Rate(*counts, where) for rat, counts in by_rat.items()}


Source = TypeVar("Source")
Cell = TypeVar("Cell")


@dataclass(frozen=True, kw_only=True)
class Rule(Generic[Source, Cell]):
    """One rule, with all that is known of it: a family's rules are in one file.

    It is applied where a modem serves all of its `needs`, to the technologies `rats`. `about` has
    the cells that it is asked about, of each scan or at the desk of a whole walk; `check` returns
    the evidence against one of them, with which `sentence` is filled. `gate` says what must hold
    before, `harmless` what else explains a finding. A finding stands unless `refuted_by` holds for
    its cell later.

    `detection` is an assumption: the share of rogue cells that break the rule among those that aim
    at what it checks. `measured` has the rate on legitimate logs by technology, `elsewhere` that of
    other logs, for technologies with too few cells. `weigh` replaces their log likelihood ratio.
    `strength`: a rule that "suffices" makes a cell suspicious without another family, one that
    "warns" has no weight.
    """

    id: str
    family: Family
    needs: tuple[Need, ...]
    gate: str
    sentence: str
    harmless: str
    detection: float
    check: Callable[[Source, Cell], Evidence | None] = lambda _source, _cell: None
    measured: Mapping[str, Rate] = field(default_factory=dict)
    elsewhere: Rate | None = None
    rats: frozenset[str] = ALL
    about: Callable[[Source], Iterable[Cell]] = cells_of_scan  # type: ignore[assignment]  # of most
    strength: Literal["adds", "suffices", "warns"] = "adds"
    weigh: Callable[[Source, Cell], float] | None = None
    refuted_by: Callable[[Source, str], bool] | None = None

    def __call__(self, check: Callable[[Source, Cell], Evidence | None]) -> "Rule[Source, Cell]":
        return replace(self, check=check)

    def rate(self, rat: str) -> Rate | None:
        """Rate on legitimate logs: of the technology, of all of them, or of other logs.

        A technology with an alarm never gets a lower rate than its own. None if it is not measured.
        """
        own = self.measured.get(rat)
        if own is not None and (own.cells >= _FEWEST_MEASURED or own.alarms >= _FEWEST_ALARMS):
            return own
        if self.elsewhere is not None or not self.measured:
            return self.elsewhere
        alarms = sum(rate.alarms for rate in self.measured.values())
        cells = sum(rate.cells for rate in self.measured.values())
        hours = sum(rate.hours for rate in self.measured.values())
        pooled = Rate(alarms, cells, hours, next(iter(self.measured.values())).where)
        if own is not None and own.alarms and own.per_cell > pooled.per_cell:
            return own
        return pooled

    def nats(self, rat: str) -> float:
        """Log likelihood ratio of a finding; never below 0."""
        rate = self.rate(rat)
        if self.strength == "warns" or rate is None:
            return 0.0
        return max(log(self.detection / rate.per_cell), 0.0)

    def text_of(self, evidence: Evidence) -> str:
        """The sentence of a finding; what ends with `_m` is metres."""
        texts = {
            name: metres(float(value)) if name.endswith("_m") else value
            for name, value in evidence.items()
        }
        return self.sentence.format(**texts).replace("%", " %")

    @property
    def text(self) -> str:
        """All that is declared, in sentences."""
        rats = "" if self.rats == ALL else f" of {' or '.join(sorted(self.rats))}"
        by_logs: dict[str, list[str]] = {}
        for rat, rate in self.measured.items():
            by_logs.setdefault(rate.where, []).append(f"{rat} {rate.text}")
        if self.elsewhere is not None:
            by_logs.setdefault(self.elsewhere.where, []).append(self.elsewhere.text)
        rates = [f" Wrong in {where}: {', '.join(by_logs[where])}." for where in by_logs]
        return (
            f"{self.id} ({self.family}): {self.sentence}. Only where: {self.gate}. Needs{rats}: "
            f"{', '.join(self.needs)}. Also seen with: {self.harmless}."
            f"{''.join(rates) or ' ' + self.rate_text(0.0)}"
        )

    def rate_text(self, nats: float) -> str:
        """How often legitimate cells break it, as that entered a finding of `nats`."""
        if self.strength == "warns":
            return "Not measured: it only warns."
        rates = filter(None, map(self.rate, ("", *self.measured)))
        known = (rate for rate in rates if isclose(log(self.detection / rate.per_cell), nats))
        if (rate := next(known, None)) is not None:
            return f"On legitimate networks: {rate.text}, in {rate.where}."
        share = min(self.detection / exp(nats), 1.0) if nats > 0.0 else 1.0
        if share >= 0.3:
            return "Rate not measured here."
        return f"Seen with {100.0 * share:.1f} % of legitimate cells or fewer."


ScanRule = Rule[Memory, HeardCell]
"""A rule that each scan asks about its named cells."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One rule that a cell broke: when, where (degrees, WGS 84), and the evidence as numbers.

    About a whole run the time is 0 and there is no place.
    """

    rule: Rule[Any, Any]
    cell: str
    t_ns: int
    lat_deg: float | None
    lon_deg: float | None
    text: str
    evidence: Evidence
    nats: float
