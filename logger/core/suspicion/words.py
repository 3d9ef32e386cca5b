"""From findings to one of three words.

The nats of findings add up over families, of each family the strongest one: new, strong and short
come together, and one cause would count three times.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from logger.core.suspicion.finding import Family, Finding, Word
from logger.core.suspicion.rates import WORD_RATES

UNUSUAL_NATS = 3.5
SUSPICIOUS_NATS = 5.0
"""Tuned on the legitimate logs: unusual at most twice an hour of driving, suspicious at most 0.1
times an hour (`rates.WORD_RATES`)."""
CONFIRMING: frozenset[Family] = frozenset({"area", "neighbours", "signal", "place", "technology"})
"""One of these must be among the families: a plan or a database alone is often wrong."""

ALONE = frozenset({"S5", "S6"})
"""Levels over the whole walk that no one place explains: enough without a second family."""


@dataclass(frozen=True, slots=True)
class Assessment:
    """The word of a cell, its score, and its findings in the order of time."""

    cell: str
    word: Word
    score_nats: float
    findings: tuple[Finding, ...]


def assess(cell: str, findings: Sequence[Finding]) -> Assessment:
    """Word and score of a cell."""
    by_family: dict[Family, float] = {}
    for finding in findings:
        by_family[finding.family] = max(by_family.get(finding.family, 0.0), finding.nats)
    score = sum(by_family.values())
    is_alone = any(f.rule in ALONE and f.nats >= SUSPICIOUS_NATS for f in findings)
    return Assessment(cell, _word(by_family, score, is_alone), score, tuple(findings))


def _word(by_family: Mapping[Family, float], score: float, is_alone: bool) -> Word:
    weighty = {family for family, nats in by_family.items() if nats > 0.0}
    if is_alone or (len(weighty) >= 2 and weighty & CONFIRMING and score >= SUSPICIOUS_NATS):
        return "suspicious"
    return "unusual" if score >= UNUSUAL_NATS else "nothing unusual"


def false_alarms_per_hour(word: Word) -> float:
    """Rate at which legitimate cells earn a word, or its upper bound; 0 for no alarm."""
    rate = WORD_RATES.get(word)
    return 0.0 if rate is None else rate.per_hour


def word_rate_text(word: Word) -> str:
    """That rate in words."""
    rate = WORD_RATES[word]
    if not rate.alarms:
        return (
            f"no legitimate cell earned this word in {rate.hours:.0f} h: "
            f"at most {rate.per_hour:.2f} an hour"
        )
    return f"legitimate cells earned this word {rate.per_hour:.2f} times an hour"


def sentences(findings: Sequence[Finding]) -> list[Finding]:
    """Findings to print: of those with one sentence, as S5 and S9, the strongest."""
    strongest: dict[str, Finding] = {}
    for finding in findings:
        other = strongest.get(finding.text)
        if other is None or finding.nats > other.nats:
            strongest[finding.text] = finding
    return [finding for finding in findings if strongest[finding.text] is finding]


def by_word(assessments: Sequence[Assessment]) -> list[Assessment]:
    """The most suspicious first."""
    return sorted(assessments, key=lambda a: (_RANK[a.word], -a.score_nats, a.cell))


_RANK: Mapping[Word, int] = {"suspicious": 0, "unusual": 1, "nothing unusual": 2}
