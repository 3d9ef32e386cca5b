"""Runs of the cases over several processes; the order of the results does not depend on them."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from multiprocessing import Pool
from typing import NamedTuple

from threadpoolctl import threadpool_limits

from .cases import CASES
from .score import Score, published_scores, score

Scores = dict[str, list[Score]]
"""By method, in the order of the runs."""


class Job(NamedTuple):
    """One world and the methods to be tried on it."""

    case: str
    seed: int
    run: int
    methods: tuple[str, ...]


def jobs_of(
    names: Iterable[str], seed: int, runs: int | None, methods: Sequence[str] | None
) -> list[Job]:
    """Jobs of some cases; None for the usual number of runs and for all methods of a case."""
    jobs = []
    for name in names:
        case = CASES[name]
        chosen = tuple(m for m in case.methods if methods is None or m in methods)
        jobs += [Job(name, seed, run, chosen) for run in range(case.count(runs))]
    return jobs


def done(job: Job) -> tuple[Job, list[Score]]:
    """Scores of all methods of one job, on one core."""
    with threadpool_limits(1):
        world = CASES[job.case].world(job.seed, job.run)
        return job, [score(world, method, job.run) for method in job.methods] + published_scores(
            world, job.run
        )


def collect_scores(
    jobs: Sequence[Job], processes: int, on_done: Callable[[], None]
) -> dict[str, Scores]:
    """Scores by case and method; `on_done` is called after each job."""
    found: dict[str, Scores] = {}
    for job, scores in _run_unordered(jobs, processes):
        for one in scores:
            found.setdefault(job.case, {}).setdefault(one.method, []).append(one)
        on_done()
    for scores_by_method in found.values():
        for column in scores_by_method.values():
            column.sort(key=lambda one: one.run)
    return {name: found[name] for name in CASES if name in found}


def _run_unordered(jobs: Sequence[Job], processes: int) -> Iterator[tuple[Job, list[Score]]]:
    if processes == 1:
        yield from map(done, jobs)
        return
    with Pool(processes) as pool:
        yield from pool.imap_unordered(done, jobs)
