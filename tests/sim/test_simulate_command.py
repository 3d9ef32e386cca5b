"""`fieldlogger simulate` with another modem, and with one that misbehaves."""

import numpy as np
import pytest

from logger.cli import main
from logger.core.runfile import read_run
from logger.sim.dialects import DIALECTS
from logger.sim.faults import FAULTS
from logger.sim.scenario import SCENARIOS


def test_another_modem_that_misbehaves(tmp_path, capsys):
    # the modem's deadlines are real seconds, of which a simulated hour has the fewer the faster it
    # goes
    command = ["simulate", "--out", str(tmp_path), "--speed", "20", "--modem", "sim7600"]
    for lasts_s in (240, 2400):  # the second for a machine that is ten times as slow
        fault = f"garbage:{lasts_s / 20}:{lasts_s / 3}"
        assert main([*command, "--duration", str(lasts_s), "--fault", fault]) == 0
        run = read_run(capsys.readouterr().out.strip())
        notes = {row["code"].decode(): row["text"].decode() for row in run.tables["notes"]}
        after = run.tables["readings"]["t_ns"] > lasts_s / 3 * 1e9
        if "garbage" in notes and np.any(after):
            break
    assert notes["modem-identified"].endswith("driver sim7600")
    assert "garbage" in notes
    assert np.any(after)


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        (["--modem", "ec25"], "no simulated modem is called 'ec25'; known are: sim800, sim7600"),
        (["--fault", "flood:1:2"], "no fault is called 'flood'"),
        (["--fault", "hang"], "NAME:FROM:TO"),
        (["--fault", "hang:1:later"], "NAME:FROM:TO"),
    ],
)
def test_a_mistake_is_one_line(tmp_path, capsys, wrong, says):
    assert main(["simulate", "--out", str(tmp_path), *wrong]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert says in line


def test_the_help_lists_every_name_in_one_piece(capsys):
    assert main(["simulate", "--help"]) == 0
    words = capsys.readouterr().out.replace(",", " ").replace(". ", " ").replace(".\n", " ").split()
    assert {*SCENARIOS, *DIALECTS, *FAULTS} <= set(words)


def test_a_fault_without_times_names_the_faults(tmp_path, capsys):
    assert main(["simulate", "--out", str(tmp_path), "--fault", "storm"]) == 2
    error = capsys.readouterr().err
    assert all(name in error for name in FAULTS)
