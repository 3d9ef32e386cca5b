"""From findings to one of three words, and to events of the run that `postproc replay` compares.

The nats of findings add up over families, of each the strongest: new, strong and short come
together, and one cause would count three times.
"""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence

from logger.core import answer
from logger.core.suspicion.earlier_walks import FEWEST_WALKS
from logger.core.suspicion.rule import WORDS, Family, Finding, Rate, Word
from logger.core.types import Level, Note

UNUSUAL_NATS = 3.5
SUSPICIOUS_NATS = 5.0
"""Tuned on the legitimate logs: unusual at most twice an hour of driving, suspicious at most 0.1
times (`WORD_RATES`)."""
CONFIRMING: frozenset[Family] = frozenset(
    {"area", "neighbours", "signal", "place", "technology", "earlier walks"}
)
"""One of these families is necessary: a plan or a database alone is often wrong."""

_MOST_REASONS = 3
_LOGS = "62 runs of telephones, mostly in cars"
WORD_RATES: Mapping[Word, Rate] = {
    "suspicious": Rate(1, 924, 38.5, _LOGS),
    "unusual": Rate(3, 924, 38.5, _LOGS),
}
"""Legitimate cells that earned each word: `make suspicion`."""

_OF_A_NEW_STATION = {"network": frozenset({"P1", "L4"}), "area": frozenset({"L1", "L2"})}
"""Rules, one of which a strong station of an invented network or area most likely breaks."""
_SHORT_S = 120.0
"""Strong stations are named after up to 72 s, the median of kinds of modems and walks."""
_NEEDED = {
    "identity": "identities",
    "country code": "country codes",
    "area code": "area codes",
    "channel": "channels",
    "colour code": "colour codes",
    "level": "levels",
    "position": "positions",
    "neighbours": "neighbours",
    "neighbour lists": "neighbour lists",
    "timing advance": "timing advances",
    "C1 and C2": "reselection offsets",
    "second technology": "a second technology",
    "cell database": "a database of cells",
}
"""Needs of rules as they stand in a sentence."""

FINDING_CODE, ERROR_CODE = "finding", "rule-failed"
"""Codes of the events of each finding, and of the error of a rule."""
_WEIGHT = re.compile(rf"^(\S+: (?:{'|'.join(WORDS)})), \S+ nats: \w+ ")
"""In what `finding_notes` writes."""
_CONSPICUOUS = re.compile(rf"(\S+): (?:{'|'.join(WORDS[1:])}), ")
_NAMES = re.compile(r"^(version \w+): [A-Z]\d+(?: [A-Z]\d+)*$")
"""In what `rules_note` writes."""


def assess(cell: str, findings: Sequence[Finding]) -> answer.Word:
    """Word and score of a cell."""
    by_family: dict[Family, float] = {}
    for finding in findings:
        family = finding.rule.family
        by_family[family] = max(by_family.get(family, 0.0), finding.nats)
    score = sum(by_family.values())
    weighty = {family for family, nats in by_family.items() if nats > 0.0}
    is_confirmed = len(weighty) >= 2 and bool(weighty & CONFIRMING) and score >= SUSPICIOUS_NATS
    word: Word = "unusual" if score >= UNUSUAL_NATS else "nothing unusual"
    strong = [finding for finding in findings if finding.nats >= SUSPICIOUS_NATS]
    if is_confirmed or any(finding.rule.strength == "suffices" for finding in strong):
        word = "suspicious"
    return answer.Word(word, score, tuple(findings), cell)


def false_alarms_per_hour(word: Word) -> float:
    """Rate of a word for legitimate cells, or its upper bound; 0 for no alarm."""
    rate = WORD_RATES.get(word)
    return 0.0 if rate is None else rate.per_hour


def word_rate_text(word: Word) -> str:
    """That rate in words, with its interval and the hours it comes from."""
    rate = WORD_RATES[word]
    low, high = (alarms / rate.hours for alarms in rate.interval)
    return (
        f"legitimate cells earned this word {rate.alarms / rate.hours:.2f} times an hour "
        f"({low:.2f} to {high:.2f}, 95 %) in {rate.hours:.1f} h of {rate.where}: {rate.alarms} of "
        f"{rate.cells} cells, so more often where a modem names many"
    )


def unnoticed_text(
    not_asked: Mapping[str, Sequence[str]], heard_s: float, n_walks: int | None
) -> str:
    """What would have been noticed, and what not, where these rules were not asked.

    Cells were heard for `heard_s`; `n_walks` is the number of earlier walks of the ground, None
    where that differs.
    """
    if heard_s < _SHORT_S:
        return (
            "Cells were heard for less than two minutes: even a strong new station may be missed."
        )
    missing = dict.fromkeys(need for needs in not_asked.values() for need in needs)
    needs = [_NEEDED[need] for need in missing if need in _NEEDED]
    hidden = [what for what, rules in _OF_A_NEW_STATION.items() if not_asked.keys() >= rules]
    can_see_new = len(hidden) < len(_OF_A_NEW_STATION)
    can_compare = {*not_asked.get("B1", ())} <= {"earlier walks"}
    unseen = ["a weak one", "one on the air for a minute or two"] if can_see_new else []
    unseen += [f"one of an invented {what}" for what in hidden if can_see_new]
    one = "one" if can_see_new else "a cell"
    if n_walks is None or n_walks < FEWEST_WALKS or not can_compare:
        unseen.append(f"{one} with a plausible identity")
    else:
        unseen.append(f"{one} that earlier walks heard too")
        unseen.append("one of a network or technology that they did not hear")
    unseen.append("a copy of a cell beside it")
    if needs:
        listed = " or ".join(filter(None, (", ".join(needs[:-1]), needs[-1])))
        unseen.append(f"one that only {listed} would betray")
    seen = (
        "a strong new station would most likely have been noticed, but not"
        if can_see_new
        else "no station would certainly have been noticed, least of all"
    )
    text = f"Here {seen} {', '.join(unseen[:-1])} or {unseen[-1]}."
    if n_walks is None:
        return text
    text += f" Earlier walks of this ground: {n_walks}"
    if n_walks < FEWEST_WALKS and can_compare:
        text += f" (from {FEWEST_WALKS} on, a strong one with a plausible identity is noticed too)"
    return f"{text}."


def sentences(findings: Sequence[Finding]) -> list[Finding]:
    """Findings to print: of those with one sentence, as S5 and S9, the strongest."""
    strongest: dict[str, Finding] = {}
    for finding in findings:
        other = strongest.get(finding.text)
        if other is None or finding.nats > other.nats:
            strongest[finding.text] = finding
    return [finding for finding in findings if strongest[finding.text] is finding]


def strongest_reasons(word: answer.Word) -> list[str]:
    """The sentences that weigh most."""
    strongest = sorted(sentences(word.findings), key=lambda finding: -finding.nats)
    return [finding.text for finding in strongest[:_MOST_REASONS]]


def reason_line(cell: str, word: answer.Word) -> str:
    """A cell, its word, and its strongest reasons in one sentence."""
    return f"{cell} is {word.word}: {'; '.join(strongest_reasons(word))}"


def by_word(assessments: Sequence[answer.Word]) -> list[answer.Word]:
    """The most suspicious first."""
    return sorted(assessments, key=lambda a: (-WORDS.index(a.word), -a.score_nats, a.cell))


def finding_notes(findings: Iterable[Finding], of: Iterable[answer.Word]) -> Iterator[Note]:
    """An event for each finding, with the word and the score of its cell after it."""
    for finding, cell in zip(findings, of, strict=True):
        level: Level = "warning" if cell.word == "suspicious" else "info"
        score = f"{cell.word}, {cell.score_nats!r} nats"
        text = f"{finding.cell}: {score}: {finding.rule.id} {finding.text}"
        yield Note(level, FINDING_CODE, text)


def conspicuous_in(notes: Iterable[Note]) -> set[str]:
    """Cells that the events of findings call unusual or suspicious."""
    texts = (_CONSPICUOUS.match(note.text) for note in notes if note.code == FINDING_CODE)
    return {text[1] for text in texts if text}


def in_plain_words(text: str) -> str:
    """The text of an event of the rules without names and weights; others as they are."""
    return _NAMES.sub(r"\1", _WEIGHT.sub(r"\1: ", text, count=1))


def error_notes(errors: Iterable[tuple[str, str]]) -> Iterator[Note]:
    """An event for each cell with an error of a rule; the name may be empty."""
    for cell, text in errors:
        of = f"{cell}: " if cell else ""
        yield Note("warning", ERROR_CODE, f"{of}a rule of suspicion failed: {text}")
