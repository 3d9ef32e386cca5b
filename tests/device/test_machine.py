from logger.device.machine import Machine, machine


def test_a_pi_says_what_it_has(tmp_path):
    throttled = tmp_path / "devices/platform/soc/soc:firmware/get_throttled"
    throttled.parent.mkdir(parents=True)
    zone = tmp_path / "class/thermal/thermal_zone0"
    zone.mkdir(parents=True)
    (zone / "temp").write_text("51540\n")
    for bits, word in (("0\n", "none"), ("50000\n", "since the start"), ("50005\n", "now")):
        throttled.write_text(bits)
        found = machine(tmp_path, tmp_path)
        assert (found.undervoltage, found.temperature_c) == (word, 51.54)
    assert found.free_bytes > 0


def test_what_is_unknown_is_none(tmp_path):
    assert machine(tmp_path / "none", tmp_path) == Machine()
