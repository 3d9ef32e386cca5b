"""The command itself: an error is found, and the answer is that of the walk without it."""

import json
import subprocess
import sys
from pathlib import Path

COMMAND = Path(__file__).resolve().parents[2] / "benchmarks" / "robustness.py"


def test_the_command_compares_with_and_without_the_error(tmp_path):
    file = tmp_path / "found.json"
    asked = ["--runs", "2", "--measured", "0", "--json", file]
    ran = subprocess.run(
        [sys.executable, COMMAND, *asked], capture_output=True, text=True, check=True
    )
    found = json.loads(file.read_text())
    assert [(one["kind"], one["found"], one["false"]) for one in found["desk"]] == [
        ("white", 1, 0),
        ("shadow", 1, 0),
    ]
    for one in (*found["desk"], *found["live"]):
        assert one["clean"] == one["clean_old"]
        assert abs(one["spiked"]["error_m"] - one["clean"]["error_m"]) < 3.0
    white = found["desk"][0]
    with_it, without_it, clean = (
        white[answer]["area_m2"] for answer in ("spiked_old", "spiked", "clean")
    )
    print(f"area in m2: {with_it:.0f} with the error, {without_it:.0f} without, {clean:.0f} clean")
    assert abs(with_it - clean) > 2.0 * abs(without_it - clean)
    assert "all simulated" in ran.stdout
    assert ran.stderr == ""
