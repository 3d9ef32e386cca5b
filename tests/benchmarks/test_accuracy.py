"""The command itself, and measured walks."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks.scoreboard.traces import world_of

COMMAND = Path(__file__).resolve().parents[2] / "benchmarks" / "accuracy.py"


def test_the_command_writes_what_it_prints(tmp_path, traces):
    files = [tmp_path / "board.json", tmp_path / "board.md"]
    asked = [
        "--quick",
        "--case",
        "measured",
        "white-L",
        "spec-10-begun",
        "--json",
        files[0],
        "--markdown",
        files[1],
    ]
    ran = subprocess.run(
        [sys.executable, COMMAND, *asked], capture_output=True, text=True, check=True
    )
    found = json.loads(files[0].read_text())
    assert [case["name"] for case in found["cases"]] == ["white-L", "spec-10-begun"]
    assert [len(case["runs"]) for case in found["cases"]] == [10 * 2, 9 * 2]
    assert {one["walks"] for one in found["targets"]} >= {"white-L", "measured, all"}
    n_walks = len((traces / "reference.csv").read_text().splitlines()) - 1
    assert len(found["measured"]) == -(-n_walks // 50)  # every fiftieth
    assert {"python", "numpy", "filterpy"} <= set(found["versions"])
    assert found["date_utc"].startswith("20")
    for text in (ran.stdout, files[1].read_text()):
        assert "white-L: white noise 3 dB" in text
        assert "exact posterior" in text
        assert text.index("measured walks") < text.index("targets") < text.index("white-L")
        assert found["date_utc"] in text


def test_a_measured_walk(traces):
    world = world_of("kuleuven_lora_p2p", "campus_1105_125358_n124")
    away_m = np.hypot(world.walk.x_m - world.sources[0][0], world.walk.y_m - world.sources[0][1])
    about = json.loads((traces / "kuleuven_lora_p2p" / "truth.json").read_text())["traces"][
        "campus_1105_125358_n124"
    ]
    assert len(world.walk) == about["n"]
    assert np.min(away_m) == pytest.approx(about["d_min_m"], rel=0.05)
    assert np.max(away_m) == pytest.approx(about["d_max_m"], rel=0.01)
    assert world.noise is None
    assert len(world.published_scores) == 2
    assert world.name == "kuleuven_lora_p2p/campus_1105_125358_n124"
