"""The command itself: a walk ends on the device and at the desktop."""

import json
import subprocess
import sys
from pathlib import Path

COMMAND = Path(__file__).resolve().parents[2] / "benchmarks" / "agreement.py"


def test_the_command_compares_device_and_desktop(tmp_path):
    file = tmp_path / "found.json"
    asked = ["--walks", "1", "--jobs", "1", "--json", file]
    ran = subprocess.run(
        [sys.executable, COMMAND, *asked], capture_output=True, text=True, check=True
    )
    (found,) = json.loads(file.read_text())
    assert (found["noise"], found["seed"]) == ("white", 0)
    assert found["live"]["verdict"] == "located"  # which ends this walk
    for name in ("live", "searched", "same_readings", "desk"):
        assert found[name]["error_m"] < found[name]["r95_m"] < 150.0
    assert "verdicts two steps apart" in ran.stdout
