"""What changed between two times: cells new, gone, moved, stronger or weaker on common ground.

All walks before a day are one walk, all since another day the other; `postproc.comparison` compares
them, with its significance, and only where both have walked.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from logger.core.errors import ConfigError
from logger.core.readings import Readings
from postproc.comparison.changes import Comparison, compare
from postproc.ground import Towns, ground_of
from postproc.result import Options
from postproc.survey.cell_location import joined_readings
from postproc.survey.dataset import Survey
from postproc.survey.location import EVERY_RUN, reports_of_loggers
from postproc.survey.scheduling import Cluster
from postproc.survey.tasks import RunChoice, runs_of, tasks_of

_RUN_STRIDE = 1 << 40
"""Between the numbers of scans of two runs."""
LEFT_OUT = "walks left out, of loggers that contradict the others or share no ground with them: {}"


def compare_times(
    survey: Survey, before: RunChoice, after: RunChoice, *, cluster: Cluster
) -> tuple[Comparison, int]:
    """The changes, and how many walks are left out: of loggers that the others do not confirm.

    Raises `ConfigError` where one of the times has no walk, and for a scheduler that does not
    answer.
    """
    choices = ((before, "before the first"), (after, "since the second"))
    times = [(runs_of(survey, choice), when) for choice, when in choices]
    for runs, when in times:
        if not runs:
            raise ConfigError(f"no walk of the survey began {when} day")
    loggers = reports_of_loggers(survey, EVERY_RUN, cluster)
    offset_db = {one.logger: one.offset_db for one in loggers if not one.contradiction}
    towns = Towns(survey.ground([run for runs, _ in times for run in runs]))
    sides, n_left_out = [], 0
    for runs, when in times:
        # what one logger reads higher than the others is no change; without others nothing is known
        known = [one for one in runs if not loggers or survey.runs[one].logger in offset_db]
        if not known:
            raise ConfigError(f"no walk {when} day is of a logger that others can confirm")
        n_left_out += len(runs) - len(known)
        sides.append(_walk(survey, known, towns, offset_db))
    return compare(*sides, same_modem=False), n_left_out


def _walk(
    survey: Survey, runs: Sequence[str], towns: Towns, offset_db: Mapping[str, float]
) -> Iterator[Readings]:
    """All readings of some runs as those of one walk, on the scale of the median logger.

    The towns lie side by side in one plane.
    """
    number = {digest: i for i, digest in enumerate(runs)}
    for task in tasks_of(survey, survey.cells(runs), EVERY_RUN, Options()):
        for parts in survey.observations(task.area, task.cells, runs).values():
            placed = {}
            for digest, obs in parts.items():
                x_m, y_m = towns.in_one_plane(ground_of(obs.places))
                placed[digest] = replace(
                    obs,
                    places=replace(obs.places, x_m=x_m, y_m=y_m),
                    level_dbm=obs.level_dbm - offset_db.get(survey.runs[digest].logger, 0.0),
                    known_limit=None,
                    scan_seq=obs.scan_seq + _RUN_STRIDE * number[digest],
                )
            # spikes are looked for in the series of each run
            obs = joined_readings(placed, list(placed))
            # a cell that has become weak is named irregularly
            yield replace(obs.everywhere(), modem=None)
