"""When a reading of channel and code alone belongs to an identity: at the desk, and live."""

import numpy as np
import pytest

from logger.core.cell_names import FEWEST_SCANS, Identities
from logger.core.joined_names import JOIN_M, JOIN_S, RecentNames
from logger.core.places import Utm, place_of_fix
from logger.core.runfile import read_run
from logger.core.types import Fix, Scan
from tests.kit.nameless import BY_CHANNEL, LAT, LON, NAMED, neighbour, records, serving
from tests.kit.runs import write_journal

OTHER = "262-01-4711-8"
UTM = Utm.at(LAT, LON)


def stream(*heard):
    """Records of (second, metres east, readings)."""
    return [
        record
        for t_s, east_m, *readings in heard
        for record in records([(east_m, 0.0)], lambda _i, _p, r=readings: r, t0_s=t_s)
    ]


def naming(t_s, east_m=0.0, **changes):
    """An identity, in as many scans as a cell needs to exist, and in one more."""
    return [(t_s + k, east_m, serving(**changes)) for k in range(FEWEST_SCANS + 1)]


def at_desk(tmp_path, given):
    path = tmp_path / "a.journal"
    write_journal(path, given)
    rows = read_run(path).named_readings
    return list(zip(rows["cell"].astype(str).tolist(), rows["identity_unsure"], strict=True))


def live(given):
    names, identities, place, found = RecentNames(), Identities(), None, []
    for record in given:
        if isinstance(record.value, Fix):
            place = place_of_fix(record.t_ns, record.value, UTM)
        else:
            scan = names.take(record.t_ns, record.value, place, identities)
            identities.add(scan)
            found += [(reading.cell, reading.identity_unsure) for reading in scan.readings]
    return found


JOINED, ALONE = (NAMED, True), (BY_CHANNEL, False)
ASKED = neighbour()
CASES = {
    "one identity": ([*naming(0), (100, 0.0, ASKED)], JOINED),
    "in the same scan": ([*naming(0), (100, 0.0, serving(), ASKED)], JOINED),
    "named once": ([(0, 0.0, serving()), (100, 0.0, ASKED)], ALONE),
    "never without doubt": ([*naming(0, identity_unsure=True), (100, 0.0, ASKED)], ALONE),
    "two identities": ([*naming(0), *naming(10, cid=8), (100, 0.0, ASKED)], ALONE),
    "the other one is far": ([*naming(0), *naming(10, 9000.0, cid=8), (100, 0.0, ASKED)], JOINED),
    "in time": ([*naming(0), (2 + int(JOIN_S), 0.0, ASKED)], JOINED),
    "too late": ([*naming(0), (3 + int(JOIN_S), 0.0, ASKED)], ALONE),
    "near": ([*naming(0), (100, JOIN_M - 20.0, ASKED)], JOINED),
    "too far": ([*naming(0), (100, JOIN_M + 20.0, ASKED)], ALONE),
    "another area": ([*naming(0), (100, 0.0, neighbour(tac=4712))], ALONE),
    "the same area": ([*naming(0), (100, 0.0, neighbour(tac=4711))], JOINED),
    "another code": ([*naming(0, pci=211), (100, 0.0, ASKED)], ALONE),
    "another channel": ([*naming(0, arfcn=5781), (100, 0.0, ASKED)], ALONE),
    "another technology": ([*naming(0, rat="NR"), (100, 0.0, ASKED)], ALONE),
    "LTE-M is LTE": ([*naming(0, rat="LTE-M"), (100, 0.0, ASKED)], JOINED),
    "its own digits are damaged": (
        [*naming(0), (100, 0.0, neighbour(pci=212, identity_unsure=True))],
        ("LTE-5780-212", True),
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_one_identity_near_in_time_and_place(case, tmp_path):
    heard, expected = CASES[case]
    given = stream(*heard)
    assert at_desk(tmp_path, given)[-1] == expected
    assert live(given)[-1] == expected


def test_the_desk_knows_what_comes_later(tmp_path):
    given = stream((50, 0.0, ASKED), *naming(100))
    assert at_desk(tmp_path, given)[0] == JOINED
    assert live(given)[0] == ALONE


def test_a_joined_reading_confirms_no_identity(tmp_path):
    """It is no witness: from place to place the name would wander away from its cell."""
    steps = [(100 + 30 * k, 1500.0 * k, ASKED) for k in range(4)]
    given = stream(*naming(0), *steps)
    assert at_desk(tmp_path, given)[-4:] == [JOINED, JOINED, ALONE, ALONE]
    assert live(given)[-4:] == [JOINED, JOINED, ALONE, ALONE]


def test_without_a_position_there_is_no_near(tmp_path):
    given = [record for record in stream(*naming(0), (100, 0.0, ASKED)) if record.source == "modem"]
    assert at_desk(tmp_path, given)[-1] == ALONE
    assert live(given)[-1] == ALONE


def test_an_import_without_times_has_no_near(tmp_path):
    write_journal(
        tmp_path / "a.journal",
        stream(*naming(0), (100, 0.0, ASKED)),
        origin="import without times of a.csv",
    )
    rows = read_run(tmp_path / "a.journal").named_readings
    assert rows["cell"][-1] == BY_CHANNEL.encode()


def test_a_run_keeps_what_was_recorded(tmp_path):
    """The names are added when it is read: table, records and digest are those of the modem."""
    given = stream(*naming(0), (100, 0.0, ASKED))
    write_journal(tmp_path / "a.journal", given)
    run = read_run(tmp_path / "a.journal")
    assert run.named_readings["cell"][-1] == NAMED.encode()
    assert run.tables["readings"]["cell"][-1] == b""
    last = [record.value for _, record in run.records("scans")][-1]
    assert last.readings[0].cell is None


def test_a_run_without_such_readings_is_not_copied(tmp_path):
    write_journal(tmp_path / "a.journal", stream(*naming(0)))
    run = read_run(tmp_path / "a.journal")
    assert run.named_readings is run.tables["readings"]


@pytest.mark.parametrize("seed", range(5))
def test_many_readings_are_joined_as_one_by_one(seed, tmp_path):
    rng = np.random.default_rng(seed)
    n = 700
    t_s = np.sort(rng.choice(4000, n, replace=False)).tolist()
    east_m = np.cumsum(rng.normal(0.0, 300.0, n)).tolist()
    kinds = rng.choice(["9", "8", "", ""], n, p=[0.02, 0.02, 0.48, 0.48]).tolist()
    heard = [
        (t, x, serving(cid=int(kind)) if kind else ASKED)
        for t, x, kind in zip(t_s, east_m, kinds, strict=True)
    ]
    found = at_desk(tmp_path, stream(*heard))
    for i, kind in enumerate(kinds):
        near = {
            k
            for t, x, k in zip(t_s, east_m, kinds, strict=True)
            if k and abs(t - t_s[i]) <= JOIN_S and abs(x - east_m[i]) <= JOIN_M
        }
        expected = f"262-01-4711-{near.pop()}" if len(near) == 1 else BY_CHANNEL
        assert found[i][0] == (f"262-01-4711-{kind}" if kind else expected)
    assert {name for name, _ in found} == {NAMED, OTHER, BY_CHANNEL}


def test_memory_of_a_long_walk_is_bounded():
    names, identities = RecentNames(), Identities()
    place = place_of_fix(0, records([(0.0, 0.0)], lambda _i, _p: [])[0].value, UTM)
    for k in range(3000):
        scan = Scan(0, (serving(arfcn=k, cid=k),))
        for _ in range(FEWEST_SCANS):
            identities.add(scan)
        names.take(k, scan, place, identities)
    assert len(names._witnesses) == 1000
