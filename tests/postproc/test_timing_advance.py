"""Timing advances in what `smooth` reports of one run and of several."""

from dataclasses import replace

import numpy as np

from logger.core.document import terminal_lines
from logger.core.places import Utm
from logger.core.runfile import RunWriter, read_run
from logger.core.types import Fix, Record, Scan
from postproc.multi_run import merge
from postproc.smoothing import smooth_runs
from postproc.summary import document_of, summarise
from postproc.walk import observe_run
from tests.kit import runs


def record_run(path, shift, ta_of, run_id="a"):
    """A run past a transmitter whose serving cell tells a TA, or none."""
    utm, x = Utm(33), np.arange(0.0, 600.0, 10.0)
    zero = np.array(utm.to_xy(52.0, 13.0))
    writer = RunWriter(path, runs.meta(run_id=f"{run_id:0>32}"))
    lat, lon = utm.to_latlon_arrays(zero[0] + x, zero[1] + shift + 0.2 * np.abs(x - 300.0))
    level = (
        -30.0
        - 28.0 * np.log10(np.hypot(x - 250.0, shift - 60.0))
        + np.random.default_rng(1).normal(0, 2, len(x))
    )
    for i in range(len(x)):
        found = replace(runs.reading(1, float(np.round(level[i]))), ta=ta_of(i))
        writer.append(
            Record(i * 10**9, "gnss", Fix(True, None, float(lat[i]), float(lon[i]), acc_m=2.0))
        )
        writer.append(Record(i * 10**9 + 5, "modem", Scan(i * 10**9, (found,))))
    writer.close(60 * 10**9, "done")
    return read_run(path)


def test_smooth_says_whether_the_ta_agree(tmp_path):
    none, near, lie = (
        smooth_runs([record_run(tmp_path / f"{name}.journal", 0.0, ta_of)])
        for name, ta_of in (
            ("none", lambda _: None),
            ("near", lambda _: 0),
            ("lie", lambda i: 9 if i % 10 else None),
        )
    )
    assert none.cells[0].timing is None
    points = near.cells[0].timing.places
    assert near.cells[0].timing.disagree == 0
    assert 10 <= points <= 16
    contradicted = lie.cells[0]
    assert contradicted.timing.disagree > 8
    assert any("timing advance disagrees" in warning for warning in contradicted.warnings)
    said_of_none, said_of_near = (
        "\n".join(terminal_lines(document_of(summarise(one), details=True)[0]))
        for one in (none, near)
    )
    assert f"timing advance: read at {points} points, 0 disagree" in said_of_near
    assert "timing" not in said_of_none


def test_runs_together_keep_the_ta_of_each(tmp_path):
    ways = {"a": (0.0, lambda _: 0), "b": (140.0, lambda _: None)}
    found = [
        record_run(tmp_path / f"{name}.journal", *way, run_id=name) for name, way in ways.items()
    ]
    parts = {i: observe_run(run).observations.cells[0] for i, run in enumerate(found)}
    joined = merge(parts, [0, 1])
    assert joined.ta.tolist() == [0] * 60 + [-1] * 60
    assert merge({1: parts[1]}, [0, 1]).ta is None
