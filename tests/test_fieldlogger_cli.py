import json
import os
import pty
import re
import subprocess
import sys
from pathlib import Path

import pytest

from logger import check as checking
from logger.cli import main
from logger.config import parse_config
from logger.core.errors import DeviceError
from logger.device.port import Port
from logger.drivers.registry import FAMILIES
from tests.kit import service
from tests.kit.faulty_card import small_file_system

REPLY = (
    '+CENG: 1,1\r\n+CENG: 0,"0666,21,00,310,260,08,4e72,04,03,0113,255"\r\n'
    '+CENG: 1,"0233,26,00,ffff,,,0000"\r\nOK\r\n'
)


def _fails(capsys, *argv):
    """The one line that a mistake costs."""
    assert main([str(a) for a in argv]) == 2
    errors = [line for line in capsys.readouterr().err.splitlines() if line]
    assert len(errors) == 1, errors
    return errors[0]


@pytest.fixture
def site(tmp_path):
    return service.site_toml(tmp_path, "/dev/ttyUSB77", "/dev/ttyUSB78")


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (
            ('port = "/dev/ttyUSB77"', 'prot = "/dev/ttyUSB77"'),
            '[modem] unknown key "prot"; did you mean "port"?',
        ),
        (("[gnss]", "[gnns]"), 'unknown key "gnns"; did you mean "gnss"?'),
        (('port = "/dev/ttyUSB78"', ""), '[gnss] missing key "port"'),
        (("[run]", "[run"), "line 1"),
        (("[gnss]", 'led = "ACT"\n[gnss]'), 'unknown key "led"; it stands under [status]'),
        (("[gnss]", '[modem]\nport = "/dev/b"\n[gnss]'), "a second modem is a [[source]]"),
        (('port = "/dev/ttyUSB78"', 'port = "/dev/b"\nport = "/dev/c"'), "its keys stand once"),
        (('"/dev/ttyUSB77"', "/dev/ttyUSB77"), "'port = /dev/ttyUSB77'; a text has straight"),
        (("interval_s = 0.05", "interval_s = 0,05"), "_s = 0,05'; a text has straight quotes"),
        (("interval_s = 0.05", 'interval_s = "1"'), "expected `float`, got `str`; without quotes"),
        (("[gnss]", "[page]\nlisten = 8080\n[gnss]"), "got `int`; a text has quotes, like"),
        (
            ("poll_interval_s = 0.05", "poll_interval_s = -1"),
            '[modem] "poll_interval_s": expected `float` > 0',
        ),
        (("poll_interval_s = 0.05", 'baud = "fast"'), '[modem] "baud": expected `int`, got `str`'),
        (("ttyUSB78", "ttyUSB77"), "name the same port"),
        (("/dev/ttyUSB77", "gpsd://localhost"), "gpsd is a receiver"),
        (('driver = "sim800"', 'driver = "sim8000"'), "no modem driver is called 'sim8000'"),
        (('driver = "sim800"', 'driver = "SIM7600E-H"'), "did you mean 'sim7600'?"),
        (('driver = "sim800"', 'driver = "Telit"'), "did you mean 'telit'?"),
        (('driver = "sim800"', 'model = "sim800"'), 'unknown key "model"; did you mean "driver"?'),
        (("[gnss]", "[gps]"), 'unknown key "gps"; did you mean "gnss"?'),
        (("poll_interval_s = 0.05", "speed = 9600"), 'key "speed"; did you mean "baud"?'),
        (('port = "/dev/ttyUSB78"', 'device = "/dev/ttyUSB78"'), '"device"; did you mean "port"?'),
    ],
)
def test_a_wrong_configuration_is_one_line_with_what_to_mend(site, capsys, change, says):
    site.write_text(site.read_text().replace(*change))
    line = _fails(capsys, "check", "--config", site)
    assert says in line
    assert str(site) in line or "driver" in line
    assert _fails(capsys, "run", "--config", site) == line


def test_missing_and_unreadable_configuration(tmp_path, capsys):
    for command in ("run", "check", "learn", "page"):
        line = _fails(capsys, command, "--config", tmp_path / "none.toml")
        assert "No such file" in line
        assert f"`fieldlogger probe --write {tmp_path / 'none.toml'}` writes one" in line
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    assert "UTF-8" in _fails(capsys, "run", "--config", tmp_path / "binary.toml")


def test_check_tells_of_a_missing_port_but_leaves_it_time(site, capsys):
    assert main(["check", "--config", str(site), "--json"]) == 0
    lines = {line["what"]: line for line in json.loads(capsys.readouterr().out)}
    assert lines["modem"]["state"] == "warn"
    assert "plugged in" in lines["modem"]["text"]


def test_check_says_that_it_has_no_configuration(capsys):
    assert main(["check"]) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[-1] == "warn  site.toml: none was checked: name it with --config"


def _with(site, table, line):
    site.write_text(f"{site.read_text()}\n[{table}]\n{line}\n")
    return site


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ('{"a": [' * 700, "nested in more than 64 levels"),
        ("{" + " " * (40 << 20), "at most 32 MB and 500000 points"),
        ("", "has no line"),
    ],
)
def test_check_refuses_streets_that_the_recorder_cannot_use(
    site, capsys, tmp_path, content, reason
):
    streets = tmp_path / "streets.geojson"
    streets.write_text(content)
    assert main(["check", "--config", str(_with(site, "live", f'streets = "{streets}"'))]) == 2
    (line,) = (line for line in capsys.readouterr().out.splitlines() if "  streets: " in line)
    assert line.startswith("fail  streets:")
    assert reason in line


def test_check_looks_at_all_files_that_the_configuration_names(site, capsys, tmp_path):
    other = tmp_path / "other"
    other.write_text("x")
    _with(site, "status", f'led = "none-like-this"\nfeed = "{other}"')
    _with(site, "page", f'map = "{other}"')
    _with(site, "live", f'baseline = "{other}"\nmost_cells = 1000')
    assert main(["check", "--config", str(site), "--json"]) == 2
    states = {line["what"]: line["state"] for line in json.loads(capsys.readouterr().out)}
    expected = {"led": "warn", "feed": "fail", "page": "fail", "baseline": "fail"}
    assert expected.items() <= states.items()
    assert states["most_cells"] == "warn"


def test_check_says_what_the_service_would_wait_for_or_miss(site, capsys):
    _with(site, "status", 'feed = "/nonexistent/folder/feed"')
    _with(site, "page", 'listen = "192.0.2.1:8080"')
    assert main(["check", "--config", str(site)]) == 0
    out = capsys.readouterr().out
    assert "there is no folder /nonexistent/folder now" in out
    assert "no network of this machine has the address 192.0.2.1 now" in out
    site.write_text(site.read_text().replace("192.0.2.1:8080", "127.0.0.1:8080"))
    assert main(["check", "--config", str(site)]) == 0
    assert "page: 127.0.0.1, port 8080" in capsys.readouterr().out


def test_check_warns_of_a_port_of_the_page_that_only_root_has(site, capsys):
    """The recorder takes no part in the page, and goes on."""
    _with(site, "page", 'listen = "127.0.0.1:80"')
    assert main(["check", "--config", str(site)]) == 0
    assert "port 80 is root's" in capsys.readouterr().out


def test_check_refuses_what_is_no_port(site, capsys, tmp_path):
    site.write_text(site.read_text().replace("/dev/ttyUSB77", str(tmp_path / "site.toml")))
    assert main(["check", "--config", str(site)]) == 2
    assert "is no serial port" in capsys.readouterr().out


def test_check_says_that_there_is_no_map(site, capsys):
    assert main(["check", "--config", str(_with(site, "page", 'map = "/none.pmtiles"'))]) == 2
    assert "fail  page: map /none.pmtiles: no such file" in capsys.readouterr().out


def test_learning_nothing_is_said(site, capsys):
    assert main(["learn", "--config", str(site)]) == 0
    out, err = capsys.readouterr()
    assert (out, err) == ("", "nothing new to learn\n")


def test_check_says_where_the_service_may_not_write(site, capsys, monkeypatch):
    """Root may, whom doctor is run as."""
    monkeypatch.setattr(checking, "SITE_TOML", site)
    assert main(["check", "--config", str(site)]) == 0
    assert f"ReadWritePaths={site.parent}/runs" in capsys.readouterr().out
    monkeypatch.setattr(checking, "SERVICE_FOLDER", site.parent)
    assert main(["check", "--config", str(site)]) == 0
    assert "ReadWritePaths" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("table", "key", "what"),
    [("live", "streets", "streets"), ("live", "baseline", "baseline"), ("page", "map", "map")],
)
def test_check_says_what_the_service_cannot_see(site, capsys, monkeypatch, table, key, what):
    _with(site, table, f'{key} = "/home/ada/file"')
    unseen = f"fail  {what}: no service sees /home/ada/file"
    assert main(["check", "--config", str(site)]) == 2
    assert unseen not in capsys.readouterr().out
    monkeypatch.setattr(checking, "SITE_TOML", site)
    assert main(["check", "--config", str(site)]) == 2
    assert unseen in capsys.readouterr().out


UNITS = Path(__file__).parents[1] / "systemd"


@pytest.mark.parametrize(
    ("listen", "is_told"),
    [
        ("10.42.0.1:8080", False),
        ("127.0.0.1:8080", False),
        ("127.0.0.1:8000", True),
        ("192.168.4.1:8080", True),
        ("[fd00::1]:8080", True),
    ],
)
def test_check_says_which_page_its_unit_lets_no_phone_reach(
    site, capsys, monkeypatch, listen, is_told
):
    _with(site, "page", f'listen = "{listen}"')
    unit = (UNITS / "fieldlogger-page.service").read_text()
    assert "\nIPAddressAllow=localhost 10.42.0.0/24\n" in unit
    assert "\nSocketBindAllow=ipv4:tcp:8080\n" in unit
    assert main(["check", "--config", str(site)]) == 0
    assert "systemctl edit fieldlogger-page" not in capsys.readouterr().out
    monkeypatch.setattr(checking, "SITE_TOML", site)
    assert main(["check", "--config", str(site)]) == 0
    assert ("systemctl edit fieldlogger-page" in capsys.readouterr().out) == is_told


@pytest.mark.parametrize(
    ("host", "is_told"), [("192.168.1.5", True), ("localhost", False), ("127.0.0.1", False)]
)
def test_check_says_which_host_the_service_does_not_reach(site, capsys, monkeypatch, host, is_told):
    site.write_text(site.read_text().replace("/dev/ttyUSB77", f"socket://{host}:4000"))
    assert "\nIPAddressAllow=localhost\n" in (UNITS / "fieldlogger.service").read_text()
    monkeypatch.setattr(checking, "SITE_TOML", site)
    assert main(["check", "--config", str(site)]) == 0
    told = "warn  modem: the service reaches 192.168.1.5 only after"
    assert (told in capsys.readouterr().out) == is_told


def test_check_warns_of_an_interval_in_milliseconds(site, capsys):
    for interval, is_told in (("2", False), ("2000", True)):
        text = site.read_text()
        site.write_text(re.sub("poll_interval_s = .*", f"poll_interval_s = {interval}", text))
        assert main(["check", "--config", str(site)]) == 0
        assert ("warn  modem: polled every 2000 s only" in capsys.readouterr().out) == is_told


def test_check_refuses_two_names_of_one_port(site, capsys, tmp_path):
    by_id = tmp_path / "by-id"
    by_id.symlink_to("/dev/ttyUSB77")
    _with(site, "[source]", f'kind = "modem"\nport = "{by_id}"')
    assert main(["check", "--config", str(site)]) == 2
    assert f"modem2: {by_id} is the port of modem, /dev/ttyUSB77" in capsys.readouterr().out


def test_check_warns_of_two_ports_of_one_modem(site, capsys, tmp_path, monkeypatch):
    """Its levels would count as those of two receivers; its receiver has a port of its own."""
    monkeypatch.setattr(checking, "SYS", tmp_path)
    places = {"77": "1-1.2:1.2", "78": "1-1.2:1.1", "79": "1-1.2:1.3", "80": "1-1.3:1.2"}
    for number, place in places.items():
        port = tmp_path / "devices" / place.partition(":")[0] / place / f"ttyUSB{number}"
        port.mkdir(parents=True)
        link = tmp_path / f"class/tty/ttyUSB{number}/device"
        link.parent.mkdir(parents=True)
        link.symlink_to(port)
    _with(site, "[source]", 'kind = "modem"\nport = "/dev/ttyUSB80"')
    assert main(["check", "--config", str(site)]) == 0
    assert "of one USB device" not in capsys.readouterr().out
    site.write_text(site.read_text().replace("ttyUSB80", "ttyUSB79"))
    assert main(["check", "--config", str(site)]) == 0
    said = "warn  modem2: /dev/ttyUSB79 and /dev/ttyUSB77 are of one USB device"
    assert said in capsys.readouterr().out


def test_the_directory_of_the_runs_must_be_usable(site, capsys):
    site.write_text(site.read_text().replace(str(site.parent / "runs"), str(site) + "/below"))
    assert "[run] directory" in _fails(capsys, "run", "--config", site)


def test_check_refuses_a_card_that_has_become_read_only(site, capsys):
    # nobody can write there, not even the user whose folder it is
    with small_file_system(site.parent / "runs", "size=1m,uid=65534,ro"):
        assert main(["check", "--config", str(site)]) == 2
    assert "runs is read-only, as a card is after an error" in capsys.readouterr().out


def test_sample_configuration_is_valid(pytestconfig):
    text = (pytestconfig.rootpath / "systemd/site.toml").read_text()
    plain = parse_config(text, "site.toml")
    full = parse_config(re.sub(r"^# (?=[a-z_0-9]+ = )", "", text, flags=re.MULTILINE), "site.toml")
    assert text.count("\n# ") > 5
    assert plain == full, "the commented lines must show the defaults"


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can become somebody without permission")
def test_a_port_without_permission_says_what_to_do():
    master, slave = pty.openpty()
    path = os.ttyname(slave)
    os.chmod(path, 0o600)
    try:
        os.seteuid(65534)
        with pytest.raises(DeviceError, match="dialout"):
            Port(path, 9600, 0.1)
    finally:
        os.seteuid(0)
        os.close(master)
        os.close(slave)


def test_port_errors_are_named(tmp_path):
    with pytest.raises(DeviceError, match="plugged in"):
        Port(str(tmp_path / "none"), 9600, 0.1)
    (tmp_path / "file").write_text("")
    with pytest.raises(DeviceError, match="no serial port"):
        Port(str(tmp_path / "file"), 9600, 0.1)


def test_parse_prints_the_fields_of_each_reading(tmp_path, capsys):
    (tmp_path / "reply.txt").write_text(REPLY, newline="")
    assert main(["parse", "--driver", "sim800", str(tmp_path / "reply.txt"), "--json"]) == 0
    serving, neighbour = json.loads(capsys.readouterr().out)
    assert {name: value for name, value in serving.items() if value is not None} == {
        "role": "serving", "rat": "GSM", "mcc": "310", "mnc": "260", "lac": 275, "cid": 20082,
        "arfcn": 666, "arfcn_raw": 666, "bsic": 8, "rxlev_raw": 21, "rxq": 0, "rssi_dbm": -92.0,
    }  # fmt: skip
    assert serving["ta"] is None
    assert (neighbour["role"], neighbour["mcc"], neighbour["rssi_dbm"]) == (
        "neighbour",
        None,
        -87.0,
    )
    assert main(["parse", "--driver", "sim800", str(tmp_path / "reply.txt")]) == 0
    assert "mcc=310" in capsys.readouterr().out


def test_parse_says_which_identity_is_unsure(tmp_path, capsys):
    (tmp_path / "reply.txt").write_text(
        '+CENG: 0,"0154,28,00,310,411,12,000f,00,05,178d,255"\n'
        '+CENG: 1,"0128,15,30,a5f,310,411,178d"\n'
    )
    assert main(["parse", str(tmp_path / "reply.txt"), "--json"]) == 0
    serving, neighbour = json.loads(capsys.readouterr().out)
    assert "identity_unsure" not in serving
    assert (neighbour["identity_unsure"], neighbour["rssi_dbm"]) == (True, -98.0)
    assert main(["parse", str(tmp_path / "reply.txt")]) == 0
    assert capsys.readouterr().out.count("identity_unsure=True") == 1


def test_parse_has_what_a_cell_broadcasts(tmp_path, capsys):
    survey = (
        "AT#CSURVC\nNetwork survey started ...\n"
        "48,24,-52,0.00,262,01,33281,3648,0,2,30 48,5,14 19 22 48 82,5,8,30,31,10,4\n"
        "52,31,-67,0.00,262,01,33281,3711,0,1,52,0\n"
        "61,31,-67,0.00,262,01,33281,3712,0,1,61\nNetwork survey ended\nOK\n"
    )
    (tmp_path / "reply.txt").write_text(survey + survey)
    assert main(["parse", str(tmp_path / "reply.txt"), "--json"]) == 0
    full, empty, unprinted = json.loads(capsys.readouterr().out)[:3]
    assert (full["neighbour_arfcns"], full["cro_db"], full["penalty_time"], full["t3212_raw"]) == (
        [14, 19, 22, 48, 82], 60, 31, 10,
    )  # fmt: skip
    assert (empty["neighbour_arfcns"], empty["cro_db"]) == ([], None)
    assert not full["broadcast_unsure"]
    assert not {"neighbour_arfcns", "broadcast"} & set(unprinted)


def test_parse_of_a_missing_file_and_an_unknown_driver(tmp_path, capsys):
    assert "No such file" in _fails(capsys, "parse", "--driver", "sim800", tmp_path / "none")
    assert "sim800" in _fails(capsys, "parse", "--driver", "nokia", tmp_path / "none")


@pytest.mark.parametrize("command", ["logger.cli", "postproc.cli"])
def test_help_imports_nothing_heavy(command):
    code = (
        f"import sys, {command}\ntry: {command}.main(['--help'])\n"
        "except SystemExit: pass\nprint(sorted(sys.modules))"
    )
    out = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout
    modules = out.splitlines()[-1]
    assert not [
        name
        for name in ("numpy", "h5py", "pyproj", "rerun", "matplotlib", "rich", "serial")
        if f"'{name}'" in modules
    ]


def test_simulate_a_short_walk(tmp_path, capsys):
    assert main(["simulate", "--out", str(tmp_path), "--duration", "60", "--speed", "20"]) == 0
    assert capsys.readouterr().out.strip().endswith(".h5")
    assert "no scenario" in _fails(capsys, "simulate", "--scenario", "moon")


@pytest.mark.parametrize("driver", ["auto", *FAMILIES])
def test_gsm_only_is_refused_where_the_driver_has_no_command_for_it(site, capsys, driver):
    chosen = f'driver = "{driver}"\nset_mode = "gsm"'
    site.write_text(site.read_text().replace('driver = "sim800"', chosen))
    if driver == "auto" or FAMILIES[driver].mode_commands:
        assert main(["check", "--config", str(site)]) == 0
        return
    line = _fails(capsys, "check", "--config", site)
    assert f"driver {driver!r} has no command for it" in line
    assert "sim7600" in line
    assert _fails(capsys, "run", "--config", site) == line


def test_another_mode_than_gsm_is_refused(site, capsys):
    site.write_text(site.read_text().replace('driver = "sim800"', 'set_mode = "lte"'))
    assert '[modem] "set_mode"' in _fails(capsys, "check", "--config", site)


@pytest.mark.parametrize("driver", FAMILIES)
def test_a_receiver_that_the_driver_does_not_read_is_refused(site, capsys, driver):
    text = site.read_text().replace('driver = "sim800"', f'driver = "{driver}"')
    site.write_text(text.replace("/dev/ttyUSB78", "modem"))
    reads = bool(FAMILIES[driver].gnss_poll_commands)
    assert main(["check", "--config", str(site)]) == (0 if reads else 2)
    assert ("name a port" in capsys.readouterr().out) == (not reads)


def test_the_help_of_parse_lists_the_drivers(capsys):
    assert main(["parse", "--help"]) == 0
    assert set(FAMILIES) <= set(re.findall(r"[\w-]+", capsys.readouterr().out))
