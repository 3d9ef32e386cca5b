"""Measured walks past a surveyed transmitter; they are beside the repository, not part of it."""

import csv
import json
from functools import cache
from pathlib import Path

import numpy as np

from logger.core.geo import Utm
from logger.core.track import UNKNOWN_SIGMA_M
from postproc.interop.walk_csv import read_walk

from .world import Walk, World

FOLDER = Path(__file__).resolve().parents[3] / "shared" / "traces"
SURVEY_SLACK_M = 10.0
"""Allowed for the surveyed place and the receiver."""
PUBLISHED = {"ls_err": "least squares (published)", "max_err": "strongest sample (published)"}


@cache
def names(classes: str) -> tuple[tuple[str, str], ...]:
    """Data set and name of the walks of some geometry classes ("A", "CDE").

    There are none where the folder is missing.
    """
    return tuple((row["dataset"], row["trace"]) for row in _reference() if row["class"] in classes)


def measured(dataset: str, trace: str) -> World:
    """One measured walk, with a standard deviation of 5 m for the positions of the receiver.

    Every import without an accuracy uses the same value.
    """
    truth = json.loads((FOLDER / dataset / "truth.json").read_text())
    about = truth["traces"][trace]
    source = truth["transmitters"][about["tx"]]
    rows = sorted(read_walk(FOLDER / dataset / about["file"])[0], key=lambda row: row.t_ns)
    utm = Utm.at(rows[0].lat_deg, rows[0].lon_deg)
    lat_deg, lon_deg, level_dbm, t_ns = (
        np.array(column, float)
        for column in zip(*((r.lat_deg, r.lon_deg, r.rssi_dbm, r.t_ns) for r in rows), strict=True)
    )
    walk = Walk(*utm.to_xy_arrays(lat_deg, lon_deg), level_dbm)
    return World(
        walk,
        walk,
        (utm.to_xy(source["lat"], source["lon"]),),
        position_sigma_m=UNKNOWN_SIGMA_M,
        slack_m=SURVEY_SLACK_M,
        t_s=1e-9 * (t_ns - t_ns[0]),
        utm=utm,
        published_scores=_read_published(dataset, trace),
        name=f"{dataset}/{trace}",
    )


def _read_published(dataset: str, trace: str) -> dict[str, float]:
    row = next(row for row in _reference() if (row["dataset"], row["trace"]) == (dataset, trace))
    return {method: float(row[column]) for column, method in PUBLISHED.items()}


@cache
def _reference() -> tuple[dict[str, str], ...]:
    table = FOLDER / "reference.csv"
    if not table.is_file():
        return ()
    with table.open(newline="") as file:
        return tuple(csv.DictReader(file))
