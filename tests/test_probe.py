import json
import tomllib
from contextlib import ExitStack
from dataclasses import replace
from itertools import product
from pathlib import Path

import pytest

from logger.cli import main
from logger.config import parse_config
from logger.device import gnss_source, modem_source
from logger.device.clock import ScaledClock
from logger.device.port import Port
from logger.drivers.registry import FAMILIES
from logger.probe import PortReport, probe, propose_config, stable_name
from logger.sim.dialects import identity_replies
from logger.sim.ptys import PtyDevice, answering, talking
from logger.sim.scenario import scenario
from logger.sim.walk import WalkTime
from tests.kit.dialects import DIALECTS
from tests.kit.faulty_card import small_file_system
from tests.kit.simulated_devices import simulated_devices

HAVE_A_RECEIVER = {"sim808", "sim7000", "sim7600", "ec25"}


@pytest.fixture
def ports():
    with simulated_devices() as (modem, gnss, silent):
        yield {modem.path: "", gnss.path: "", silent.path: ""}


@pytest.fixture(scope="module", autouse=True)
def patience():
    """A busy machine answers as well, later."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(modem_source, "PROBE_TRIES", 5)
        patch.setattr(gnss_source, "PROBE_S", 2.5)
        yield


@pytest.fixture(scope="module")
def looked_at(patience):
    """What is found on the port of each simulated modem, of a receiver, of nobody and of none."""
    walk, time = scenario("block", 1, 600.0), WalkTime(ScaledClock(20.0))
    sessions = {name: answering(walk.modem(time.now_s, DIALECTS[name])) for name in DIALECTS}
    sessions |= {"receiver": talking(walk.receiver(), time), "silent": lambda _line: None}
    with ExitStack() as stack:
        paths = [stack.enter_context(PtyDevice(session)).path for session in sessions.values()]
        found = dict(zip(sessions, probe(dict.fromkeys(paths, ""), bauds=(115_200,)), strict=True))
        found["none"] = PortReport("/dev/ttyUSB9", "", "busy", text="in use by another program")
        yield found


def test_each_device_is_known_by_what_it_says(ports):
    modem, gnss, silent = probe(ports, bauds=(115_200,))
    assert (modem.kind, modem.driver, modem.baud) == ("modem", "sim800", 115_200)
    assert "SIM800" in modem.text
    assert (gnss.kind, gnss.driver) == ("gnss", None)
    assert silent.kind == "unknown"


def test_a_modem_is_asked_whether_it_has_a_receiver(looked_at):
    assert {name for name in DIALECTS if looked_at[name].receiver} == HAVE_A_RECEIVER
    assert {looked_at[name].kind for name in DIALECTS} == {"modem"}


def test_a_receiver_that_may_keep_its_modem_from_cells_is_not_proposed():
    walk, time = scenario("block", 1, 600.0), WalkTime(ScaledClock(20.0))
    identity = identity_replies(["SIM7080G R1951"], "SIMCOM_Ltd", "SIMCOM_SIM7080G", "1951B05")
    modem = walk.modem(time.now_s, replace(DIALECTS["sim7000"], identity=identity))
    with PtyDevice(answering(modem)) as port:
        (found,) = probe({port.path: ""}, bauds=(115_200,))
    assert (found.driver, found.receiver) == ("sim7000", False)


@pytest.mark.parametrize("receiver", ["receiver", "silent", "none"])
@pytest.mark.parametrize("modem", [*DIALECTS, "silent", "none"])
def test_check_accepts_every_proposal_or_says_what_to_fill_in(
    looked_at, tmp_path, capsys, modem, receiver
):
    proposal = propose_config([looked_at[modem], looked_at[receiver]], tmp_path / "runs")
    site = tmp_path / "site.toml"
    site.write_text(proposal.text)
    fixes = receiver == "receiver" or modem in HAVE_A_RECEIVER
    whole = modem in DIALECTS and fixes
    assert (proposal.advice == "") == whole
    assert main(["check", "--config", str(site)]) == (0 if whole else 2)
    if whole:
        port = tomllib.loads(proposal.text)["gnss"]["port"]
        assert port == (looked_at["receiver"].port if receiver == "receiver" else "modem")
    else:
        (line,) = capsys.readouterr().err.splitlines()
        assert '"port" is empty; `fieldlogger probe`' in line
        table = "modem" if modem not in DIALECTS else "gnss"
        assert f"fill in [{table}] port" in proposal.advice
        assert f"fill in [{table}] port" in proposal.text
        assert "\n" not in proposal.advice


@pytest.mark.parametrize(("driver", "asked"), [*product(FAMILIES, [True, None])])
def test_the_receiver_of_a_modem_is_proposed_where_its_driver_reads_one(driver, asked):
    found = [PortReport("/dev/ttyUSB2", "", "modem", 115_200, driver, "a modem", asked)]
    port = tomllib.loads(propose_config(found).text)["gnss"]["port"]
    assert port == ("modem" if FAMILIES[driver].gnss_poll_commands else "")


@pytest.mark.parametrize("driver", FAMILIES)
def test_the_proposal_says_where_no_driver_knows_the_model(driver):
    text = propose_config([PortReport("/dev/ttyUSB2", "", "modem", 9600, driver, "ACME 1")]).text
    assert ("# no driver knows this model" in text) == (driver == "generic")
    assert tomllib.loads(text)["modem"]["driver"] == driver


def test_the_proposal_is_a_configuration():
    found = [
        PortReport("/dev/ttyUSB0", "", "gnss", 9600),
        PortReport("/dev/ttyUSB1", "", "modem", 115_200, "sim800", "SIM800"),
    ]
    config = parse_config(propose_config(found).text, "proposal")
    modem, receiver = config.source
    assert (modem.port, modem.driver) == ("/dev/ttyUSB1", "sim800")
    assert receiver.port == "/dev/ttyUSB0"
    nothing = tomllib.loads(propose_config([]).text)
    assert (nothing["modem"]["port"], nothing["gnss"]["port"]) == ("", "")


def test_more_modems_are_proposed_as_sources_once_each():
    """A modem with several AT ports has one name under /dev/serial/by-id and several numbers."""
    by_id = "/dev/serial/by-id/usb-SimTech_SIM7600-if"
    found = [
        PortReport(f"{by_id}02-port0", "", "modem", 115_200, "sim7600", "SIM7600", True),
        PortReport(f"{by_id}03-port0", "", "modem", 115_200, "sim7600", "SIM7600", True),
        PortReport("/dev/serial/by-id/usb-CP2102-if00-port0", "", "modem", 9600, "sim800", "A"),
        PortReport("/dev/ttyUSB9", "", "gnss", 9600),
    ]
    config = parse_config(propose_config(found).text, "proposal")
    ports = {source.name: source.port for source in config.source}
    assert ports == {"modem": found[0].port, "gnss": found[3].port, "modem2": found[2].port}
    assert config.source[-1].baud == 9600


def test_equal_devices_without_a_number_are_named_by_their_usb_sockets(tmp_path, monkeypatch):
    """Two modems of one model, and their four ports: /dev/serial/by-id has two names only."""
    monkeypatch.setattr("logger.probe._NAMES", tmp_path)
    names = [f"by-path/usb-0:1.{socket}:1.{port}-port0" for socket in (2, 3) for port in (2, 3)]
    names += [f"by-id/usb-SimTech_0123456789ABCDEF-if0{port}-port0" for port in (2, 3)]
    for number, name in zip((0, 1, 2, 3, 2, 3), names, strict=True):
        link = tmp_path / name
        link.parent.mkdir(exist_ok=True)
        link.symlink_to(f"/dev/ttyUSB{number}")
    found = [
        PortReport(stable_name(f"/dev/ttyUSB{number}"), "1e0e:9001 SimTech", "modem", 115_200)
        for number in range(4)
    ]
    assert [Path(one.port).name for one in found] == [Path(name).name for name in names[:4]]
    receiver = PortReport("/dev/ttyACM0", "", "gnss", 9600)
    config = parse_config(propose_config([*found, receiver]).text, "proposal")
    assert [one.port for one in config.source if one.gives_cells] == [found[0].port, found[2].port]
    for number in (0, 1):  # one modem alone keeps its name at any socket
        (tmp_path / names[number]).unlink()
    assert stable_name("/dev/ttyUSB2") == str(tmp_path / names[4])


def test_no_name_and_no_word_of_a_modem_breaks_the_file():
    odd = 'a"b\\c\x07\x7f'
    found = [
        PortReport(f"/dev/{odd}", "", "modem", 9600, "sim800", f"says {odd}\nport = 1"),
        PortReport("/dev/ü", "", "gnss", 9600),
    ]
    config = parse_config(propose_config(found).text, "proposal")
    assert [source.port for source in config.source] == [f"/dev/{odd}", "/dev/ü"]


def test_the_command_prints_the_proposal_and_never_writes_over_a_file(ports, tmp_path, capsys):
    site = tmp_path / "site.toml"
    modem, gnss, _ = ports
    assert main(["probe", modem, gnss, "--write", str(site), "--json"]) == 0
    assert [one["kind"] for one in json.loads(capsys.readouterr().out)] == ["modem", "gnss"]
    assert parse_config(site.read_text(), "site").source[0].port == modem
    assert main(["probe", modem, gnss, "--write", str(site)]) == 2
    said = capsys.readouterr().err
    assert "File exists; move it away" in said
    assert "probing" not in said
    assert main(["probe", modem, "--write", str(tmp_path / "none" / "site.toml")]) == 2
    assert capsys.readouterr().err == f"fieldlogger: {tmp_path / 'none'}: no such folder\n"


def test_a_port_may_be_named_as_users_name_it(ports, tmp_path, monkeypatch, capsys):
    # a configuration takes complete paths only
    monkeypatch.chdir(tmp_path)
    (tmp_path / "modem").symlink_to(next(iter(ports)))
    assert main(["probe", "modem", "ttyNONE", "--json"]) == 2
    modem, none = json.loads(capsys.readouterr().out)
    assert (modem["port"], modem["kind"]) == (str(tmp_path / "modem"), "modem")
    assert none["port"] == "/dev/ttyNONE"


def test_where_no_file_can_be_written_no_port_is_asked(tmp_path, capsys):
    with small_file_system(tmp_path / "card", "ro,size=1m") as card:
        assert main(["probe", "/dev/none", "--write", str(card / "site.toml")]) == 2
    said = capsys.readouterr().err
    assert said == f"fieldlogger: {card}: no permission; use sudo, or name another folder\n"


def test_what_is_missing_is_one_line(tmp_path, capsys):
    site = tmp_path / "site.toml"
    assert main(["probe", str(tmp_path / "none"), "--write", str(site)]) == 2
    progress, advice = capsys.readouterr().err.splitlines()
    assert progress.startswith("probing ")
    assert advice.startswith("fieldlogger: no modem has answered")
    assert "no receiver has answered" in advice
    assert "no such port" in advice
    assert "fill in [modem] port" in site.read_text()


def test_the_first_thing_is_to_stop_what_has_the_ports(ports):
    # the logger itself, of a user who has started it and whose modem then moved
    with Port(next(iter(ports)), 115_200, 0.1):
        advice = propose_config(probe(ports, bauds=(115_200,))).advice
    assert advice.startswith(f"port {next(iter(ports))}: in use by another program")
    assert advice.index("sudo systemctl stop fieldlogger") < advice.index("no modem has answered")


def test_a_port_that_is_not_there_is_told(tmp_path):
    (one,) = probe({str(tmp_path / "none"): ""})
    assert one.kind == "busy"
    assert "plugged in" in one.text
