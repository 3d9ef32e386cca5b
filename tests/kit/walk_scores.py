"""Scores of measured walks that were never measured."""

from benchmarks.scoreboard.measured import WalkScore
from benchmarks.scoreboard.traces import Trace


def scored_walk(
    name="day_1",
    *,
    campaign="powder_frs462",
    closest_m=10.0,
    geometry="A",
    covered=True,
    area_km2=0.5,
    transmitter="",
    **more,
):
    """Score of one walk; `name` is its session."""
    values = {
        "variant": "",
        "readings": 100,
        "error_m": 20.0,
        "strongest_m": 40.0,
        "held": (False, covered, covered),
        "area_m2": (1e3, 1e4, 1e6 * area_km2),
        "r95_m": 300.0,
        "log_density": 1.0,
        "verdict": "cannot tell",
        "seconds": 0.1,
    }
    return WalkScore(
        Trace(campaign, f"{name}_walk", geometry, closest_m, transmitter), **(values | more)
    )
