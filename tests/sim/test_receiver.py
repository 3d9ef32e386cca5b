from datetime import UTC, datetime, timedelta

import numpy as np
import pynmea2
import pytest

from logger.drivers.protocols.nmea import FixAssembler, NmeaFramer
from logger.sim.devices import GnssNoise, SimulatedReceiver, sentence
from logger.sim.walk import Walk, waypoints
from logger.sim.world import Radio, World

START = datetime(2024, 12, 31, 23, 59, 50, 500_000, tzinfo=UTC)
WALK = Walk(waypoints("square", 300.0, np.random.default_rng(0)))
NOISELESS = GnssNoise(0.0, 60.0, 0.0)


def receiver(noise=None, cold_start_s=0.0, origin=(46.948, 7.4474), seed=0):
    world = World.build((), *origin, Radio(), np.random.default_rng(0))
    return world, SimulatedReceiver(
        world, WALK, START, np.random.default_rng(seed), noise, cold_start_s
    )


def parse(epoch):
    return [pynmea2.parse(line, check=True) for line in epoch.decode("ascii").splitlines()]


def test_cold_start_byte_by_byte():
    _, device = receiver(cold_start_s=30.0)

    assert device.epoch(29.0) == (
        b"$GNRMC,,V,,,,,,,,,,N*4D\r\n$GNGGA,,,,,,0,00,99.99,,,,,,*56\r\n"
        b"$GNGSA,A,1,,,,,,,,,,,,,99.99,99.99,99.99*2E\r\n"
    )
    assert device.epoch(30.0).startswith(b"$GNRMC,000020.50,A,")


def test_fix_byte_by_byte():
    _, device = receiver(NOISELESS, origin=(0.0, 0.0))
    epoch = device.epoch(0.0)

    assert epoch.startswith(b"$GNRMC,235950.50,A,0000.00000,N,00000.00000,E,")
    assert b",0.00,311224,,,A*" in epoch.splitlines()[0]
    assert (
        sentence("GNGGA,235950.50,0000.00000,N,00000.00000,E,1,12,0.92,540.0,M,48.0,M,,") in epoch
    )
    assert sentence("GNGSA,A,3,02,05,12,15,21,24,25,29,67,68,77,84,1.68,0.92,1.41") in epoch


@pytest.mark.parametrize("origin", [(46.948, 7.4474), (-33.93, -70.6), (59.99999999, 179.5)])
def test_every_epoch_parses_and_lands_at_the_true_place(origin):
    world, device = receiver(NOISELESS, origin=origin)

    for t_s in range(0, 900, 50):
        rmc, gga, gsa = parse(device.epoch(float(t_s)))
        east_m, north_m = world.to_local(rmc.latitude, rmc.longitude)
        assert (east_m, north_m) == pytest.approx(WALK.position(t_s), abs=0.03)
        assert (gga.latitude, gga.longitude) == (rmc.latitude, rmc.longitude)
        assert rmc.datetime.replace(tzinfo=UTC) == START + timedelta(seconds=t_s)
        assert (rmc.status, gga.gps_qual, gga.num_sats, gsa.mode_fix_type) == ("A", 1, "12", "3")


def test_speed_is_that_of_the_walk():
    _, device = receiver()

    knots = [parse(device.epoch(float(t_s)))[0].spd_over_grnd for t_s in range(100)]

    assert np.mean(knots) * 1852 / 3600 == pytest.approx(1.3, abs=0.03)


def test_error_is_three_metres_and_wanders_within_a_minute():
    _, device = receiver()
    errors_m = np.array([device._advance(float(t_s))[:2] for t_s in range(20_000)])

    assert errors_m.std(axis=0) == pytest.approx(3.0, rel=0.2)
    lagged = (errors_m[60:] * errors_m[:-60]).mean() / (errors_m**2).mean()
    assert lagged == pytest.approx(np.exp(-1.0), abs=0.12)


def test_epochs_land_within_the_noise():
    world, device = receiver(seed=4)
    errors_m = []
    for t_s in range(0, 900, 10):
        rmc = parse(device.epoch(float(t_s)))[0]
        errors_m.append(
            np.subtract(world.to_local(rmc.latitude, rmc.longitude), WALK.position(t_s))
        )

    assert 0.5 < np.std(errors_m) < 5.0
    assert np.abs(errors_m).max() < 15.0


def test_minutes_never_round_to_sixty():
    _, device = receiver(NOISELESS, origin=(47.0 - 1e-9, 8.0 - 1e-9))

    assert b",4700.00000,N,00800.00000,E," in device.epoch(0.0)


def test_the_driver_makes_one_fix_of_each_epoch():
    _, device = receiver(cold_start_s=3.0)
    framer, assembler = NmeaFramer(), FixAssembler()
    fixes = [
        fix
        for t_s in range(6)
        for event in framer.feed(device.epoch(float(t_s)))
        for _, fix in assembler.feed(event, t_s)
    ]

    assert [fix.valid for fix in fixes] == [False, False, False, True, True, True]
    assert fixes[3].utc_ns == round((START + timedelta(seconds=3)).timestamp() * 1e9)
