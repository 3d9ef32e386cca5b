"""Receivers at 5 and 10 Hz over midnight: every epoch is one fix with its own values, however the
bytes are cut.
"""

import random
from datetime import UTC, datetime

import pytest

from logger.drivers.protocols.nmea import FixAssembler, NmeaFramer, Sentence, radius68_m
from logger.sim.devices import sentence
from tests.kit.framers import split_at

SECONDS = 40
START_NS = int(datetime(2026, 9, 21, 23, 59, 40, tzinfo=UTC).timestamp()) * 10**9


def epoch_ns(i, rate_hz):
    return START_NS + i * 10**9 // rate_hz


def clock(i, rate_hz, digits=2):
    t_ns = epoch_ns(i, rate_hz)
    fraction = f"{t_ns % 10**9:09d}"[:digits]
    return f"{datetime.fromtimestamp(t_ns // 10**9, UTC):%H%M%S}" + (
        f".{fraction}" if digits else ""
    )


def lat(i):
    return f"5230.{i:05d}"


def gga(i, rate_hz):
    return (
        f"GNGGA,{clock(i, rate_hz)},{lat(i)},N,01315.00000,E,1,12,0.8,{40 + i / 100:.2f},M,40.0,M,,"
    )


def rmc(i, rate_hz):
    date = f"{datetime.fromtimestamp(epoch_ns(i, rate_hz) // 10**9, UTC):%d%m%y}"
    return f"GNRMC,{clock(i, rate_hz)},A,{lat(i)},N,01315.00000,E,{i / 100:.2f},84.4,{date},,,A,V"


def rmc_of_three_digits(i, rate_hz):
    return rmc(i, rate_hz).replace(clock(i, rate_hz), clock(i, rate_hz, 3))


def gst(i, rate_hz):
    return f"GNGST,{clock(i, rate_hz)},20,,,,{1 + i / 100:.2f},{2 + i / 100:.2f},5.0"


def gsa(system):
    return lambda *_: f"GNGSA,A,3,01,02,03,04,,,,,,,,,1.5,0.8,1.2,{system}"


def vtg(i, _):
    return f"GNVTG,84.4,T,,M,{i / 100:.2f},N,{i * 1.852 / 100:.3f},K,A"


def once_a_second(body):
    return lambda i, rate_hz: body if i % rate_hz == 0 else None


GSV = once_a_second("GPGSV,3,1,11,03,03,111,00,04,15,270,00,06,01,010,00,13,06,292,00")
ORDERS = {
    "u-blox": [rmc, vtg, gga, gsa(1), gsa(3), GSV, gst],
    "accuracy first": [gst, gga, gsa(1), gsa(2), rmc],
    "motion last": [gga, gst, gsa(1), vtg, GSV, rmc],
    "satellites between": [gga, GSV, gsa(1), rmc_of_three_digits, gst],
    "accuracy once a second": [
        gga,
        rmc,
        lambda i, rate_hz: gst(i, rate_hz) if i % rate_hz == 0 else None,
    ],
}


def nmea_of(order, rate_hz):
    """All sentences, epoch by epoch, as bytes."""
    bodies = [make(i, rate_hz) for i in range(SECONDS * rate_hz) for make in ORDERS[order]]
    return b"".join(sentence(body) for body in bodies if body)


def fixes_of(chunks):
    framer, assembler = NmeaFramer(), FixAssembler()
    events = [event for chunk in chunks for event in framer.feed(chunk)]
    assert all(isinstance(event, Sentence) for event in events)
    found = [fix for t_ns, event in enumerate(events) for _, fix in assembler.feed(event, t_ns)]
    return found + [fix for _, fix in assembler.flush()]


@pytest.mark.parametrize("rate_hz", [5, 10])
@pytest.mark.parametrize("order", ORDERS)
def test_no_fix_is_lost_and_none_has_values_of_another(order, rate_hz):
    data = nmea_of(order, rate_hz)
    chance = random.Random(f"{order} {rate_hz}")
    found = fixes_of(split_at(data, [chance.randrange(1, 400) for _ in range(len(data))]))
    assert len(found) == SECONDS * rate_hz
    for i, fix in enumerate(found):
        assert fix.utc_ns == epoch_ns(i, rate_hz)
        assert fix.lat_deg == pytest.approx(52.5 + i * 1e-5 / 60, abs=1e-9)
        assert fix.alt_m == pytest.approx(40 + i / 100)
        assert fix.speed_mps == pytest.approx(i / 100 * 1852 / 3600)
        if "once" not in order:
            assert fix.acc_m == pytest.approx(radius68_m(1 + i / 100, 2 + i / 100))


@pytest.mark.parametrize("rate_hz", [5, 10])
@pytest.mark.parametrize("order", ORDERS)
def test_damage_costs_the_epochs_it_hits_at_most(order, rate_hz):
    data = bytearray(nmea_of(order, rate_hz))
    chance = random.Random(order)
    n_hit = 20
    for at in chance.sample(range(len(data)), n_hit):
        data[at] ^= 0x80  # shows in the checksum
    framer, assembler = NmeaFramer(), FixAssembler()
    events = [event for event in framer.feed(bytes(data)) if isinstance(event, Sentence)]
    found = [fix for event in events for _, fix in assembler.feed(event, 0)] + [
        fix for _, fix in assembler.flush()
    ]
    told_of = {float(e.text.split(",")[1]) for e in events if e.text[3:6] in {"GGA", "RMC"}}
    assert len(found) == len(told_of) >= SECONDS * rate_hz - n_hit // 2  # who lost both is lost
    assert sum(fix.utc_ns is None for fix in found) <= n_hit
    times_ns = [fix.utc_ns for fix in found if fix.utc_ns is not None]
    assert times_ns == sorted(set(times_ns))
    assert set(times_ns) <= {epoch_ns(i, rate_hz) for i in range(SECONDS * rate_hz)}


def stamps_s(rate_hz, arrivals_s, clock_s=lambda s: s):
    """Times of the fixes of epochs that are read at `arrivals_s`."""
    assembler = FixAssembler()
    found = []
    for i in range(SECONDS * rate_hz):
        t_s = i / rate_hz
        shown = epoch_ns(0, 1) + round(clock_s(t_s) * 1e9)
        time = f"{datetime.fromtimestamp(shown // 10**9, UTC):%H%M%S}.{shown % 10**9 // 10**7:02d}"
        body = f"GNGGA,{time},{lat(i)},N,01315.00000,E,1,12,0.8,40.0,M,40.0,M,,"
        for event in NmeaFramer().feed(sentence(body)):
            found += [t_ns / 1e9 for t_ns, _ in assembler.feed(event, round(arrivals_s(t_s) * 1e9))]
    return found


@pytest.mark.parametrize("rate_hz", [1, 5, 10])
@pytest.mark.parametrize("stall_s", [1.7, 10.0])
@pytest.mark.parametrize("n_reads", [1, 2])
def test_epochs_read_at_once_after_a_stall_have_their_own_times(rate_hz, stall_s, n_reads):
    begin_s, end_s = 15.05, 15.05 + stall_s

    def arrival_s(t_s):
        if not begin_s < t_s < end_s:
            return t_s
        is_first = n_reads == 2 and t_s < (begin_s + end_s) / 2
        return end_s - stall_s / 4 if is_first and stall_s > 2.0 else end_s

    found = stamps_s(rate_hz, arrival_s)
    assert found == pytest.approx([i / rate_hz for i in range(len(found))], abs=0.02)


@pytest.mark.parametrize("rate_hz", [1, 5, 10])
@pytest.mark.parametrize("step_s", [-18.0, -2.0, -0.6, 0.3, 1.0, 18.0])
def test_a_step_of_the_receivers_clock_moves_no_fix(rate_hz, step_s):
    found = stamps_s(rate_hz, lambda s: s, lambda s: s + 30.0 + (step_s if s > 20.0 else 0.0))
    assert found == pytest.approx([i / rate_hz for i in range(len(found))])


def test_jitter_of_a_slow_line_moves_a_fix_to_its_due_time_at_most():
    chance = random.Random(1)
    late = {s: chance.uniform(0.0, 0.3) for s in range(SECONDS)}
    found = stamps_s(1, lambda s: s + late[round(s)])
    assert found == pytest.approx([s + late[s] for s in range(SECONDS)])
