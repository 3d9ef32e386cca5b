from dataclasses import replace

import numpy as np
import pytest

from logger.core.errors import EstimationError, GeoError
from logger.core.places import DEAD_RECKONING_SIGMA_M, UNKNOWN_SIGMA_M, fix_sigma_m
from logger.core.readings import observe
from logger.core.runfile import read_run
from logger.core.types import CellReading, Fix, Record, Scan
from logger.drivers.sim800 import Sim800
from tests.kit import runs

S = 10**9


def _observe(tmp_path, records):
    path = tmp_path / "a.journal"
    path.unlink(missing_ok=True)
    runs.write_journal(path, records)
    tables = read_run(path).tables
    return observe(tables["fixes"], tables["scans"], tables["readings"])


def _fix(t_s, lon, **more):
    return Record(round(t_s * S), "gnss", Fix(True, None, 52.0, lon, **more))


def _scan(start_s, end_s, *readings, fix_seq=None):
    return Record(round(end_s * S), "modem", Scan(round(start_s * S), readings, fix_seq=fix_seq))


def test_a_reading_stands_where_the_walker_was_in_the_middle_of_the_scan(tmp_path):
    found = _observe(
        tmp_path, [_fix(0, 13.0), _fix(10, 13.001), _scan(3, 7, runs.reading(1, -70.0))]
    )
    (obs,) = found.cells
    x0_m, x1_m = found.track.x_m
    assert obs.x_m[0] == pytest.approx((x0_m + x1_m) / 2, abs=1e-6)
    assert obs.level_dbm.tolist() == [-70.0]
    assert (obs.cell, obs.rat) == ("262-01-4711-1", "GSM")


@pytest.mark.parametrize("acc_m", [None, 3.0, 80.0])
@pytest.mark.parametrize("hdop", [None, 0.9, 9.9])
@pytest.mark.parametrize("quality", [None, 1, 2, 3, 4, 5, 6])
def test_dead_reckoning_has_a_large_sigma_live_and_offline(tmp_path, acc_m, hdop, quality):
    """Whatever the receiver says of its accuracy: it does not know of a turn since it lost its
    satellites.
    """
    sigma_m = fix_sigma_m(acc_m, hdop, quality)
    measured_m = fix_sigma_m(acc_m, hdop)
    fixes = [_fix(t, 13.0, acc_m=acc_m, hdop=hdop, quality=quality) for t in (0, 10)]
    found = _observe(tmp_path, [*fixes, _scan(5, 5, runs.reading(1, -70.0))])
    assert found.track.sigma_m == pytest.approx([sigma_m] * 2)
    assert found.cells[0].position_sigma_m[0] == pytest.approx(sigma_m)
    assert sigma_m == pytest.approx(
        np.hypot(measured_m, DEAD_RECKONING_SIGMA_M) if quality == 6 else measured_m
    )


def test_what_cannot_be_used_is_counted(tmp_path):
    found = _observe(
        tmp_path,
        [
            _fix(0, 13.0),
            _fix(60, 13.001),
            _scan(0, 0, runs.reading(1, -70.0), CellReading("neighbour", "GSM", rssi_dbm=-80.0)),
            _scan(30, 30, runs.reading(1, -71.0)),  # in the middle of a gap of a minute
            _scan(61, 61, CellReading("serving", "GSM", "262", "01", 1, 2)),
            _scan(62, 62, runs.reading(1, -72.0)),  # just after the last fix
        ],
    )
    assert (
        found.n_readings,
        found.n_without_position,
        found.n_without_identity,
        found.n_without_level,
    ) == (5, 1, 1, 1)
    assert found.cells[0].level_dbm.tolist() == [-70.0, -72.0]


def test_level_without_a_dbm_scale_is_the_nominal_one(tmp_path):
    bare = CellReading("serving", "GSM", "262", "01", 1, 2, rxlev_raw=40)
    found = _observe(tmp_path, [_fix(0, 13.0), _scan(0, 0, bare)])
    assert found.cells[0].level_dbm.tolist() == [bare.level_dbm] == [-70.0]


def test_accuracy_of_the_receiver(tmp_path):
    records = [_fix(0, 13.0, hdop=2.0), _fix(1, 13.0, acc_m=15.096), _fix(2, 13.0)]
    assert _observe(tmp_path, records).track.sigma_m == pytest.approx([8.0, 10.0, 7.0])


def test_several_fixes_at_one_time_keep_their_positions(tmp_path):
    """A file whose clock counts whole seconds, or nothing at all."""
    found = _observe(
        tmp_path,
        [
            _fix(5, 13.0), _scan(5, 5, runs.reading(1, -70.0), fix_seq=0),
            _fix(5, 13.001), _scan(5, 5, runs.reading(1, -71.0), fix_seq=2),
        ],
    )  # fmt: skip
    assert found.cells[0].x_m.tolist() == found.track.x_m.tolist()


def test_no_fix_and_no_map(tmp_path):
    with pytest.raises(EstimationError, match="no position fix"):
        _observe(tmp_path, [Record(0, "gnss", Fix(False)), _scan(1, 1, runs.reading(1, -70.0))])
    with pytest.raises(GeoError, match="84 deg"):
        _observe(tmp_path, [Record(0, "gnss", Fix(True, None, 85.0, 0.0))])


def test_time_order_whatever_the_order_of_arrival(tmp_path):
    late_first = [
        _fix(0, 13.0),
        _fix(9, 13.0),
        _scan(8, 8, runs.reading(1, -8.0)),
        _scan(1, 1, runs.reading(1, -1.0)),
    ]
    obs = _observe(tmp_path, late_first).cells[0]
    assert obs.level_dbm.tolist() == [-1.0, -8.0]
    assert np.all(np.diff(obs.t_ns) > 0)


def test_a_long_scan_is_smeared_over_the_way_walked_meanwhile(tmp_path):
    fixes = [_fix(t, 13.0 + 2e-5 * t) for t in range(0, 61, 5)]
    found = _observe(
        tmp_path, sorted([*fixes, _scan(0, 60, runs.reading(1, -70.0))], key=lambda r: r.t_ns)
    )
    (obs,) = found.cells
    walked_m = found.track.x_m[-1] - found.track.x_m[0]
    np.testing.assert_allclose(obs.x_m, np.mean(found.track.x_m[[0, -1]]), atol=0.01)
    np.testing.assert_allclose(
        obs.position_sigma_m, np.hypot(UNKNOWN_SIGMA_M, walked_m / np.sqrt(12)), rtol=1e-3
    )


def _reading(ta, **changed):
    known = CellReading("serving", "GSM", "262", "01", 1, 2, rssi_dbm=-70.0, ta=ta)
    return replace(known, **changed)


def test_timing_advance_of_the_serving_gsm_cell_alone(tmp_path):
    cells = _observe(
        tmp_path,
        [
            _fix(0, 13.0),
            _scan(1, 1, _reading(3)),
            _scan(2, 2, _reading(None)),
            _scan(3, 3, _reading(5, role="neighbour")),
            _scan(4, 4, _reading(0)),
            _scan(5, 5, _reading(7, rat="LTE", lac=None, tac=9)),
            _fix(9, 13.0),
        ],
    ).cells
    gsm, lte = cells
    assert gsm.ta.tolist() == [3, -1, -1, 0]
    assert gsm.part(gsm.t_ns > 10**9).ta.tolist() == [-1, -1, 0]
    assert replace(gsm, level_dbm=np.array([-70.0, np.nan, -70.0, -70.0])).usable().ta.tolist() == [
        3,
        -1,
        0,
    ]
    assert lte.ta is None
    assert lte.part(slice(None)).ta is None


def test_timing_advance_of_a_transcript(tmp_path):
    """255, the SIM800's word for none, never arrives; a number does."""
    row = '+CENG: 0,"0154,28,00,310,411,12,000f,00,05,178d,{}"'
    scans = [
        _scan(t, t, *Sim800().read([row.format(ta)]))
        for t, ta in ((1, "255"), (2, "04"), (3, "63"))
    ]
    (obs,) = _observe(tmp_path, [_fix(0, 13.0), *scans, _fix(9, 13.0)]).cells
    assert obs.ta.tolist() == [-1, 4, 63]
