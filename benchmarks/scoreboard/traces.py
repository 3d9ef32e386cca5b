"""Measured walks past a surveyed transmitter; they are beside the repository, not part of it."""

import csv
import json
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from . import tree
from .world import Place, Walk, World

FOLDER = Path(__file__).resolve().parents[3] / "shared" / "traces"
SURVEY_SLACK_M = 10.0
"""Allowed for the surveyed place and the receiver."""
SUNLAB = "SunLab (published)"
_SUNLAB_M = {"20231204_145749": 57.0, "20231213_124502": 37.0, "20231213_162720": 130.0}
"""Errors of the only team that published its estimates, after ten minutes of each flight."""
PUBLISHED = {"ls_err": "least squares (published)", "max_err": "strongest sample (published)"}

_SESSION_PARTS = {"kuleuven_lora_p2p": 2, "powder_frs462": 2, "lyon_bike_lora": 1}
"""How much of a trace's name, between underlines, names its session.

A session is a day in Leuven, a tour in Salt Lake City (several receivers), a ride in Lyon (two
radios). The routes of a data set that is not listed are one session.
"""


class Trace(NamedTuple):
    """A measured walk: data set, name, geometry class A to E, and closest distance to the truth.

    `transmitter` is the name of the one it passes within the data set.
    """

    campaign: str
    name: str
    geometry: str
    closest_m: float
    transmitter: str = ""

    @property
    def session(self) -> str:
        """The walks of a session share a receiver, a track or a transmitter."""
        parts = self.name.split("_")[: _SESSION_PARTS.get(self.campaign, 0)]
        return "/".join([self.campaign, "_".join(parts)]) if parts else self.campaign


@cache
def traces() -> tuple[Trace, ...]:
    """All measured walks; none where the folder is missing."""
    return tuple(
        Trace(
            row["dataset"],
            row["trace"],
            row["class"],
            float(row["dmin"]),
            _truth(row["dataset"])["traces"][row["trace"]]["tx"],
        )
        for row in _reference()
    )


def names(classes: str) -> tuple[tuple[str, str], ...]:
    """Data set and name of the walks of some geometry classes ("A", "CDE")."""
    return tuple((one.campaign, one.name) for one in traces() if one.geometry in classes)


def observe(dataset: str, trace: str) -> tuple[tree.Readings, Place]:
    """Readings of a measured walk as `postproc import FILE` has them, and the transmitter."""
    truth = _truth(dataset)
    about = truth["traces"][trace]
    source = truth["transmitters"][about["tx"]]
    obs = tree.observations(FOLDER / dataset / about["file"])
    return obs, obs.utm.to_xy(source["lat"], source["lon"])


def world_of(dataset: str, trace: str) -> World:
    """One measured walk."""
    obs, source = observe(dataset, trace)
    walk = Walk(obs.x_m, obs.y_m, obs.level_dbm)
    return World(
        walk,
        walk,
        (source,),
        position_sigma_m=obs.position_sigma_m,
        slack_m=SURVEY_SLACK_M,
        t_s=1e-9 * (obs.t_ns - obs.t_ns[0]).astype(np.float64),
        utm=obs.utm,
        published_scores=_read_published(dataset, trace),
        name=f"{dataset}/{trace}",
    )


def _read_published(dataset: str, trace: str) -> dict[str, float]:
    row = next(row for row in _reference() if (row["dataset"], row["trace"]) == (dataset, trace))
    published = {method: float(row[column]) for column, method in PUBLISHED.items()}
    return published | ({SUNLAB: _SUNLAB_M[trace]} if trace in _SUNLAB_M else {})


@cache
def _truth(dataset: str) -> dict[str, Any]:
    return json.loads((FOLDER / dataset / "truth.json").read_text())


@cache
def _reference() -> tuple[dict[str, str], ...]:
    table = FOLDER / "reference.csv"
    if not table.is_file():
        return ()
    with table.open(newline="") as file:
        return tuple(csv.DictReader(file))
