from logger.core.locator.online_values import LevelReading, ReadingsInOrder


def test_readings_are_kept_in_order_and_bounded():
    readings = ReadingsInOrder()
    for k in range(3000):
        readings.add(LevelReading(float(k), 0.0, 4.0, -70.0, 0))
    x_m = readings.columns()[0]
    assert 200 <= len(x_m) <= 401
    assert (x_m[1:] - x_m[:-1] == x_m[1] - x_m[0]).all()
    assert x_m[0] == 0.0
    assert x_m[-1] > 2900.0


def test_without_readings_there_are_no_columns():
    assert ReadingsInOrder().columns().shape == (5, 0)
