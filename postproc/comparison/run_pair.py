"""The comparison of two runs: their walks in one UTM zone, and what changed between them."""

from dataclasses import dataclass, replace
from pathlib import Path

from logger.core.errors import EstimationError
from logger.core.places import Utm
from logger.core.readings import Observations
from logger.core.runfile import Run
from postproc.comparison.changes import Comparison, compare
from postproc.multi_run import check_different, in_one_zone, modems_of, of_one_modem
from postproc.walk import observe_run


@dataclass(frozen=True, slots=True)
class ComparedRuns:
    """Two runs and their comparison; `utm` is the zone of the blocks."""

    a: Path
    b: Path
    same_modem: bool
    warnings: tuple[str, ...]
    utm: Utm
    comparison: Comparison


def compare_runs(a: Run, b: Run) -> ComparedRuns:
    """Compare two runs.

    Raises `ConfigError` for one run twice, `EstimationError` for a run without a position,
    `GeoError` for runs too far apart.
    """
    check_different([a, b])
    observed = in_one_zone([observe_run(a), observe_run(b)])
    walks: list[Observations] = []
    for run in observed:
        if run.observations is None:
            raise EstimationError(f"{run.run.path}: {run.warnings[0]}")
        # a level differs from another modem's by more than a station changes
        cells = tuple(map(of_one_modem, run.observations.cells))
        walks.append(replace(run.observations, cells=cells))
    numbers = modems_of([a, b])
    same_modem = numbers[0] == numbers[1]
    compared = compare(walks[0].cells, walks[1].cells, same_modem=same_modem)
    warnings = tuple(f"{run.run.path}: {text}" for run in observed for text in run.warnings)
    return ComparedRuns(a.path, b.path, same_modem, warnings, walks[0].track.utm, compared)
