import numpy as np
import pytest

from logger.core.model.path_loss import log_distance_db
from logger.sim.scenario import SCENARIOS, scenario
from tests.kit.dialects import DIALECTS


def test_the_walk_lasts_half_an_hour():
    assert scenario().duration_s == pytest.approx(1860.0, rel=0.05)
    assert scenario(duration_s=60.0).duration_s == 60.0


def test_it_passes_the_target_and_keeps_off_the_others():
    block = scenario()
    east_m, north_m = block.walk.positions(np.arange(0.0, block.duration_s))
    centre = east_m.mean(), north_m.mean()

    nearest_m = np.hypot(east_m - block.target.east_m, north_m - block.target.north_m).min()
    others_m = [
        np.hypot(t.east_m - centre[0], t.north_m - centre[1]) for t in block.world.transmitters[1:]
    ]

    assert 20.0 < nearest_m < 60.0
    assert len(others_m) == 5
    assert all(200.0 < distance_m < 900.0 for distance_m in others_m)


def test_cells_are_distinguished():
    cells = scenario().world.transmitters

    assert len(cells) == len({cell.cid for cell in cells}) == len({cell.arfcn for cell in cells})


def test_the_same_seed_gives_the_same_bytes():
    said = []
    for seed in (1, 1, 2):
        block = scenario(seed=seed)
        modem, receiver = block.modem(lambda: 200.0), block.receiver()
        said.append((modem.feed(b"AT+CENG=1,1\rAT+CENG?\r" * 5), receiver.epoch(40.0)))

    assert said[0] == said[1]
    assert said[0][0] != said[2][0]
    assert said[0][1] != said[2][1]


def test_the_clear_world_is_the_formula():
    clear = scenario("clear")
    east_m, north_m = clear.walk.positions(np.arange(0.0, 900.0, 10.0))

    heard_dbm = clear.world.received_dbm(east_m, north_m, np.random.default_rng(0))

    assert np.abs(heard_dbm - clear.world.levels_dbm(east_m, north_m)).max() <= 0.5


def test_modems_are_chosen_by_name():
    block = scenario()

    assert b"Quectel" in block.modem(lambda: 0.0, DIALECTS["ec25"]).feed(b"ATI\r")
    assert b"SIM800" in block.modem(lambda: 0.0).feed(b"ATI\r")


def test_unknown_scenario_is_named():
    with pytest.raises(ValueError, match="'moon'"):
        scenario("moon")


def _most_likely_place(east_m, north_m, level_dbm):
    """Best place on a grid of 10 m, P0 and eta fitted at each with weak priors around -30 dBm and
    3.
    """
    grid_m = np.arange(-200.0, 500.0, 10.0)
    fits = []
    for x_m in grid_m:
        for y_m in grid_m:
            log_db = log_distance_db(east_m - x_m, north_m - y_m)
            rows = np.vstack(
                [np.column_stack([np.ones_like(log_db), -log_db]), [6 / 15, 0.0], [0.0, 6 / 0.6]]
            )
            target = np.append(level_dbm, [6 / 15 * -30.0, 6 / 0.6 * 3.0])
            theta, *_ = np.linalg.lstsq(rows, target, rcond=None)
            fits.append((float(np.square(target - rows @ theta).sum()), x_m, y_m))
    return min(fits)[1:]


@pytest.mark.parametrize("seed", [1, 2])
def test_the_target_can_be_located(seed):
    block = scenario(seed=seed)
    east_m, north_m = block.walk.positions(np.arange(0.0, block.duration_s, 10.0))
    level_dbm = block.world.received_dbm(east_m, north_m, np.random.default_rng(seed))[0]

    x_m, y_m = _most_likely_place(east_m, north_m, level_dbm)

    assert np.hypot(x_m - block.target.east_m, y_m - block.target.north_m) < 80.0


def test_every_scenario_has_a_receiver_that_starts_cold():
    for name in SCENARIOS:
        receiver = scenario(name).receiver()
        assert b"$GNRMC,,V" in receiver.epoch(0.0)
        assert b",A," in receiver.epoch(31.0)
