"""`fieldlogger simulate` with another modem, and with one that misbehaves."""

import numpy as np
import pytest

from logger.cli import main
from logger.core.runfile import read_run


def test_another_modem_that_misbehaves(tmp_path, capsys):
    # the modem's deadlines are real seconds: a reply lost to the noise costs two to eight of them, and a run of 200 s
    # leaves more than eight after the noise
    command = ["simulate", "--out", str(tmp_path), "--duration", "200", "--speed", "20"]
    assert main([*command, "--modem", "ec25", "--fault", "garbage:10:30"]) == 0
    run = read_run(capsys.readouterr().out.strip())
    notes = {row["code"].decode(): row["text"].decode() for row in run.tables["notes"]}
    assert notes["modem-identified"].endswith("driver quectel")
    assert "garbage" in notes
    after = run.tables["readings"]["t_ns"] > 32e9
    assert np.any(after)


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        (["--modem", "nokia"], "no simulated modem is called 'nokia'"),
        (["--fault", "flood:1:2"], "no fault is called 'flood'"),
        (["--fault", "hang"], "NAME:FROM:TO"),
        (["--fault", "hang:1:later"], "NAME:FROM:TO"),
    ],
)
def test_a_mistake_is_one_line(tmp_path, capsys, wrong, says):
    assert main(["simulate", "--out", str(tmp_path), *wrong]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert says in line
