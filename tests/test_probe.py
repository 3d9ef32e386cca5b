import json
import tomllib

import pytest

from logger.cli import main
from logger.config import parse_config
from logger.probe import Found, probe, site_toml
from tests.kit.sim import devices


@pytest.fixture
def ports():
    with devices() as (modem, gnss, silent):
        yield {modem.path: "", gnss.path: "", silent.path: ""}


def test_each_device_is_known_by_what_it_says(ports):
    modem, gnss, silent = probe(ports, bauds=(115_200,))
    assert (modem.kind, modem.driver, modem.baud) == ("modem", "sim800", 115_200)
    assert "SIM800" in modem.text
    assert (gnss.kind, gnss.driver) == ("gnss", None)
    assert silent.kind == "unknown"


def test_the_proposal_is_a_configuration():
    found = [Found("/dev/ttyUSB0", "", "gnss", 9600), Found("/dev/ttyUSB1", "", "modem", 115_200, "sim800", "SIM800")]
    config = parse_config(site_toml(found), "proposal")
    assert (config.modem.port, config.modem.driver, config.gnss.port) == ("/dev/ttyUSB1", "sim800", "/dev/ttyUSB0")
    nothing = tomllib.loads(site_toml([]))
    assert (nothing["modem"]["port"], nothing["gnss"]["port"]) == ("", "")


def test_the_command_prints_the_proposal_and_never_writes_over_a_file(ports, tmp_path, capsys):
    site = tmp_path / "site.toml"
    modem, gnss, _ = ports
    assert main(["probe", modem, gnss, "--write", str(site), "--json"]) == 0
    assert [one["kind"] for one in json.loads(capsys.readouterr().out)] == ["modem", "gnss"]
    assert parse_config(site.read_text(), "site").modem.port == modem
    assert main(["probe", modem, gnss, "--write", str(site)]) == 2
    assert "File exists" in capsys.readouterr().err


def test_a_port_that_is_not_there_is_told(tmp_path):
    (one,) = probe({str(tmp_path / "none"): ""})
    assert one.kind == "busy"
    assert "plugged in" in one.text
