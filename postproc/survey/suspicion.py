"""The words of suspicion of every run, each asked once, and the worst word of each cell.

A run is asked alone and without earlier walks: rules look at the order of the scans of one
receiver. The number of runs stands beside the word.
"""

from collections import Counter
from collections.abc import Iterator, Sequence

import msgspec

from logger.core.cell_names import is_by_channel
from logger.core.document import number_of
from logger.core.suspicion.rule import WORDS, Finding, Word
from logger.core.suspicion.rules import RULES, rules_version
from logger.core.suspicion.words import assess, strongest_reasons, unnoticed_text
from logger.core.types import known_utc_text
from postproc.ground import days_text
from postproc.progress import with_progress
from postproc.survey import layout
from postproc.survey.cell_location import LocatedCell
from postproc.survey.dataset import Survey
from postproc.survey.estimates import append_lines, whole_lines
from postproc.survey.rule_inputs import RuleColumn, run_of
from postproc.survey.scheduling import Cluster
from postproc.suspicion.run_assessment import failures_of, in_several_places, track

_RUNS_AT_ONCE = 16
"""Of a task: a second or two of work for walks of an hour."""


class CellWord(msgspec.Struct, frozen=True):
    """A word that is not "nothing unusual", its rules and its reasons, the weightiest first.

    A line without reasons, of an earlier program, is not read.
    """

    cell: str
    word: Word
    rules: tuple[str, ...]
    reasons: tuple[str, ...]


class RunWords(msgspec.Struct, frozen=True):
    """What the rules of a version say of the cells of a run.

    Lines with a number as the version, of earlier programs, are not read.
    """

    run: str
    version: str
    cells: tuple[CellWord, ...]
    unnoticed: str = ""


RunsOfBatch = tuple[Survey, tuple[str, ...]]
"""A survey of one batch, and some of its runs."""


def words_of_runs(survey: Survey, runs: Sequence[str], cluster: Cluster) -> list[RunWords]:
    """The words of some runs; those not asked before are asked on the cluster.

    Raises `RunFileError` where they cannot be kept.
    """
    path = survey.folder / "words.jsonl"
    version = rules_version()
    lines = whole_lines(path, RunWords)
    known = {one.run: one for one in lines if one.version == version and one.unnoticed}
    tasks = list(_tasks(survey, set(runs) - set(known)))
    arriving = cluster.results(ask_runs, tasks)
    for _, found in with_progress(arriving, "suspicion", len(tasks)):
        append_lines(path, found)
        known |= {one.run: one for one in found}
    return [known[digest] for digest in runs if digest in known]


def ask_runs(task: RunsOfBatch) -> list[RunWords]:
    """The words of some runs of a batch."""
    survey, runs = task
    return [_ask(run, inputs) for run, inputs in survey.rule_inputs(survey.batches[0], runs)]


def with_words(
    survey: Survey, cells: Sequence[LocatedCell], runs: Sequence[RunWords]
) -> tuple[LocatedCell, ...]:
    """Cells with their worst word over the runs that heard them there, and its rules."""
    asked = {cell.cell for cell in survey.cells([run.run for run in runs])} if runs else set()
    said: dict[str, dict[str, CellWord]] = {}
    for run in runs:
        for one in run.cells:
            said.setdefault(one.cell, {})[run.run] = one
    places: dict[str, list[LocatedCell]] = {}
    for cell in cells:
        if cell.n_places > 1 and _is_checked(cell):
            places.setdefault(cell.cell, []).append(cell)
    return tuple(
        _with_places(
            _with_word(
                cell,
                [one for run, one in said.get(cell.cell, {}).items()
                 if cell.n_places == 1 or run in cell.runs],
            ),
            places.get(cell.cell, ()),
        )
        if cell.cell in asked and _is_checked(cell)
        else cell
        for cell in cells
    )  # fmt: skip


def _is_checked(cell: LocatedCell) -> bool:
    # rules are about cells that two scans of a run have named
    return cell.n_scans > cell.n_runs and not is_by_channel(cell.cell)


def unnoticed_in(runs: Sequence[RunWords]) -> str:
    """What the rules could not see in most runs."""
    texts = Counter(run.unnoticed for run in runs)
    return texts.most_common(1)[0][0] if texts else ""


def _with_word(cell: LocatedCell, said: Sequence[CellWord]) -> LocatedCell:
    worst = max((one.word for one in said), key=WORDS.index, default=WORDS[0])
    of_word = [one for one in said if one.word == worst]
    rules = tuple(dict.fromkeys(rule for one in of_word for rule in one.rules))
    reasons = max((one.reasons for one in of_word), key=len, default=())
    return msgspec.structs.replace(
        cell, word=worst, word_rules=rules, word_reasons=reasons, word_runs=len(of_word)
    )


def _with_places(cell: LocatedCell, places: Sequence[LocatedCell]) -> LocatedCell:
    # S11 asks about all runs together
    rule = in_several_places
    nats = rule.weigh({}, cell.cell) if rule.weigh and places else 0.0
    text = f"heard in {len(places)} places, farther apart than a cell reaches: "
    text += "; ".join(map(_place_text, places))
    own = assess(cell.cell, [Finding(rule, cell.cell, 0, None, None, text, {}, nats)])
    if not own.is_conspicuous:
        return cell
    is_alone = cell.word == WORDS[0]
    return msgspec.structs.replace(
        cell,
        word=own.word if is_alone else cell.word,
        word_rules=(*cell.word_rules, rule.id),
        word_reasons=(*cell.word_reasons, text),
        word_runs=sum(one.n_runs for one in places) if is_alone else cell.word_runs,
    )


def _place_text(cell: LocatedCell) -> str:
    days = days_text(known_utc_text(cell.first_utc_ns), known_utc_text(cell.last_utc_ns))
    return f"{cell.heard_near} ({number_of(cell.n_runs, 'run')}{days})"


def _tasks(survey: Survey, waiting: set[str]) -> Iterator[RunsOfBatch]:
    for batch, runs in survey.runs_of_batches.items():
        has_rules = layout.rules_file(survey.folder, batch).exists()
        some = [run for run in runs if has_rules and run in waiting]
        for first in range(0, len(some), _RUNS_AT_ONCE):
            few = tuple(some[first : first + _RUNS_AT_ONCE])
            yield survey.without_contents(batch), few


def _ask(run: str, inputs: Sequence[RuleColumn]) -> RunWords:
    tracker = track(run_of(inputs))
    failures_of(tracker)  # logged, as the words of the other cells and rules stand
    cells = []
    for one in tracker.assessments():
        if one.is_conspicuous:
            strongest = sorted(one.findings, key=lambda finding: -finding.nats)
            rules = tuple(dict.fromkeys(finding.rule.id for finding in strongest))
            cells.append(CellWord(one.cell, one.word, rules, tuple(strongest_reasons(one))))
    capabilities = tracker.capabilities
    unnoticed = unnoticed_text(capabilities.not_asked(RULES.values()), capabilities.heard_s, None)
    return RunWords(run, rules_version(), tuple(cells), unnoticed)
