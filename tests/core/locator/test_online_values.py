from logger.core.locator.online_values import ReadingsInOrder
from tests.kit.walks import single_reading


def test_readings_are_kept_in_order_and_bounded():
    readings = ReadingsInOrder()
    for k in range(3000):
        readings.add(single_reading(float(k), 0.0, -70.0))
    x_m = readings.readings().x_m
    assert 200 <= len(x_m) <= 401
    assert (x_m[1:] - x_m[:-1] == x_m[1] - x_m[0]).all()
    assert x_m[0] == 0.0
    assert x_m[-1] > 2900.0


def test_without_readings_there_are_none():
    assert len(ReadingsInOrder().readings()) == 0
