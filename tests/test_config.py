"""What `check` accepts can be recorded and read; all else is one line."""

import json
import math
import tomllib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from logger.cli import main
from logger.config import load_config, parse_config
from logger.core.errors import ConfigError
from logger.core.live import LiveTracker
from logger.core.runfile import RunMeta, RunWriter, finish_journal, read_run
from logger.device.port import check_url
from logger.device.startup import usable_folder
from tests.kit import runs, service

NUMBERS = st.one_of(
    st.floats(allow_nan=True, allow_infinity=True),
    st.integers(),
    st.sampled_from(
        [0.0, -0.0, 1e-300, 1e300, 1e9, 1.0, math.inf, -math.inf, math.nan, 2**63, 2**64, -1]
    ),
)
TEXTS = st.one_of(
    st.text(),
    st.sampled_from(["", "strongest", "262-01-801-86355", "modem", "~nouser/x", "a\0b", "\x1b[2J"]),
)
VALUES = st.one_of(NUMBERS, TEXTS, st.booleans(), st.lists(st.integers(), max_size=2))
KEYS = {
    "run": ["directory"],
    "modem": ["port", "driver", "baud", "poll_interval_s", "full_scan_interval_s"],
    "gnss": ["port", "baud"],
    "live": [
        "target",
        "hysteresis_db",
        "lost_s",
        "give_up_s",
        "max_fix_age_s",
        "joseph",
        "most_cells",
        "environment",
        "antenna",
        "reach",
        "height_m",
        "baseline",
    ],
    "status": ["led"],
}
WELL = {
    "run": {"directory": "runs"},
    "modem": {"port": "/dev/ttyUSB0"},
    "gnss": {"port": "/dev/ttyUSB1"},
    "live": {"target": "strongest", "environment": "any"},
}


def _toml(value):
    if isinstance(value, float):
        return repr(value)  # inf and nan as TOML writes them
    return json.dumps(value, ensure_ascii=True) if not isinstance(value, str) else _string(value)


def _string(text):
    return '"' + "".join(f"\\U{ord(c):08X}" for c in text) + '"'


@st.composite
def sites(draw):
    """A site.toml that is right but for up to four values, so that some pass and others do not."""
    wanted = {table: dict(values) for table, values in WELL.items()}
    for _ in range(draw(st.integers(0, 4))):
        table = draw(st.sampled_from(sorted(KEYS)))
        key = draw(st.sampled_from(KEYS[table]))
        wanted.setdefault(table, {})[key] = draw(NUMBERS if table == "live" else VALUES)
    lines = []
    for table, values in wanted.items():
        lines += [f"[{table}]", *(f"{key} = {_toml(value)}" for key, value in values.items())]
    return "\n".join(lines)


@given(sites())
@settings(max_examples=300, deadline=None)
def test_any_site_that_is_accepted_gives_a_run_that_reads_back(tmp_path_factory, text):
    """Recorded by the writer with the live estimate behind it, finished, and read in both forms."""
    folder = tmp_path_factory.mktemp("site")
    try:
        config = parse_config(text, "site.toml")
        for source in config.source:
            check_url(source.port)
    except ConfigError:
        return
    plain = {
        name: getattr(runs.meta(), name)
        for name in ("run_id", "boot_id", "started_ns", "origin", "program")
    }
    writer = RunWriter(folder / "a.journal", RunMeta(**plain, config_text=text, live=config.live))
    tracker = LiveTracker(config.live)
    for record in runs.records(8):
        tracker.feed(writer.append(record), record)
    writer.close(10**10, "test")
    for path in (folder / "a.journal", finish_journal(folder / "a.journal")):
        run = read_run(path)
        assert (run.meta.live, run.meta.config_text) == (config.live, text)
        assert len(run.tables["readings"]) == 16


@given(st.text(st.sampled_from("abrunmodegs[]{}=.\"'\\\n #,0123456789_-\0\x1b"), max_size=60))
@settings(max_examples=500, deadline=None)
def test_any_text_is_a_configuration_or_one_clear_error(text):
    with pytest.raises(ConfigError):
        parse_config(text, "site.toml")


@pytest.mark.parametrize(
    "text",
    [
        "a = " + "[" * 100_000,
        "a = [\n" + "[\n" * 100_000,
        "a = " + "9" * 5000,
        "a." * 50_000 + "b = 1",
        ("a." * 2000 + "b = 1\n") * 20,
    ],
    ids=len,
)
def test_what_no_parser_takes_is_one_error_too(text):
    with pytest.raises(ConfigError):
        parse_config(text, "site.toml")


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        ("", ("any", "any", None)),
        ('reach = "any"\nantenna = "any"', ("any", "any", None)),
        ('reach = "near"\nantenna = "omni"\nheight_m = 5.0', ("near", "omni", 5.0)),
        ('reach = "far"\nantenna = "sector"\nheight_m = 0', ("far", "sector", 0.0)),
    ],
)
def test_reach_antenna_and_height_are_any_unless_set(lines, expected):
    ports = '[modem]\nport = "/a"\n[gnss]\nport = "/b"\n'
    live = parse_config(f'[run]\ndirectory = "r"\n{ports}[live]\n{lines}\n', "site.toml").live
    assert (live.reach, live.antenna, live.height_m) == expected


def test_a_height_in_words_is_refused_with_what_toml_has():
    ports = '[modem]\nport = "/a"\n[gnss]\nport = "/b"\n'
    text = f'[run]\ndirectory = "r"\n{ports}[live]\nheight_m = "tall"\n'
    with pytest.raises(ConfigError, match=r'"height_m": expected `float`, got `str`'):
        parse_config(text, "site.toml")


NO_MEANING = [
    *(
        ("live", key, value)
        for key in ("lost_s", "give_up_s", "max_fix_age_s", "height_m")
        for value in ("inf", "nan", "-1.0", "1e300")
    ),
    *(("live", "hysteresis_db", value) for value in ("nan", "-1.0", "-inf")),
    *(
        ("live", "most_cells", value)
        for value in ("0", "-3", "9223372036854775808", "100000000000000000000000")
    ),
    ("live", "target", '""'),
    ("live", "target", f'"{65 * "x"}"'),
    *(("modem", "poll_interval_s", value) for value in ("1e-300", "0", "nan", "inf", "1e12")),
    *(("modem", "full_scan_interval_s", value) for value in ("-1", "nan", "inf")),
    ("modem", "baud", "99999999999999999999999"),
    ("run", "directory", '"a\\u0000b"'),
    ("status", "led", '"a\\u0000b"'),
    ("modem", "port", '"/dev/tty\\u0000"'),
]


SITE = '[run]\ndirectory = "r"\n'
MODEM, GNSS = '[modem]\nport = "/a"\n', '[gnss]\nport = "/b"\n'
MORE = '[[source]]\nkind = "modem"\nport = "/c"\n'


@pytest.mark.parametrize(
    ("tables", "expected"),
    [
        (MODEM + GNSS, "modem:/a gnss:/b"),
        (MODEM + '[gnss]\nport = "modem"\n', "modem:/a:fixes"),
        (MODEM + '[gnss]\nport = "gpsd://h"\nbaud = 4800\n', "modem:/a gnss:gpsd://h"),
        (MODEM + GNSS + MORE, "modem:/a gnss:/b modem2:/c"),
        (MODEM + GNSS + MORE + 'name = "sim800"\n', "modem:/a gnss:/b sim800:/c"),
        (MODEM + GNSS + MORE + 'name = "modem"\n', "modem2:/a gnss:/b modem:/c"),
        (GNSS + MORE, "gnss:/b modem:/c"),
        (MORE + "fixes = true\n", "modem:/c:fixes"),
        (MODEM.replace("/a", "rfc2217://h:4000") + GNSS, "modem:rfc2217://h:4000 gnss:/b"),
        (MODEM.replace("/a", "loop://") + GNSS, "modem:loop:// gnss:/b"),
        (MORE + '[[source]]\nkind = "nmea"\nport = "/d"\n', "modem:/c gnss:/d"),
        (MORE + '[[source]]\nkind = "gpsd"\nport = "gpsd://h"\n', "modem:/c gnss:gpsd://h"),
    ],
)
def test_short_forms_and_sources_are_one_list(tables, expected):
    sources = parse_config(SITE + tables, "site.toml").source
    fixes = [":fixes" if getattr(one, "fixes", False) else "" for one in sources]
    found = [f"{one.name}:{one.port}{own}" for one, own in zip(sources, fixes, strict=True)]
    assert " ".join(found) == expected


@pytest.mark.parametrize(
    ("tables", "says"),
    [
        (MODEM, 'missing table "gnss": no source gives positions'),
        (GNSS, 'missing table "modem": no source receives cells'),
        (MODEM + GNSS + MORE.replace("/c", "/a"), "[modem] and [[source]] 1 name the same port"),
        (MODEM + GNSS + MORE + MORE, "[[source]] 1 and [[source]] 2 name the same port '/c'"),
        (MODEM + 'name = "x"\n' + GNSS + MORE + 'name = "x"\n', 'have the same name "x"'),
        (MODEM + GNSS + '[[source]]\nport = "/c"\n', '[[source]] 1 missing key "kind" (one of'),
        (MODEM + GNSS + MORE.replace("modem", "modm"), "valid are modem, nmea, gpsd"),
        (MODEM + GNSS + MORE.replace("port", "prot"), '[[source]] 1 unknown key "prot"; did you'),
        (MODEM + GNSS + MORE + 'name = "Big"\n', '[[source]] Big "name": a lower-case letter'),
        (MODEM + GNSS + MORE + 'name = "logger"\n', "is the name of a part of the program"),
        (MODEM + GNSS + MORE + "fixes = true\n", "[gnss] and [[source]] 1 give positions"),
        (MODEM + GNSS + MORE.replace("/c", ""), '[[source]] 1 "port" is empty; `fieldlogger'),
        (MODEM + GNSS + MORE.replace("/c", "gpsd://h"), "gpsd is a receiver"),
        (MORE + '[[source]]\nkind = "gpsd"\nport = "/d"\n', 'kind "gpsd" is for gpsd://host'),
        (MODEM + GNSS + MORE + "poll_interval_s = 1e9\n", '[[source]] 1 "poll_interval_s": 1'),
        (MODEM + '[gnss]\nport = "modem"\nprt = 1\n', '[gnss] unknown key "prt"; did you mean'),
        (MODEM.replace("/a", "COM3") + GNSS, "'COM3' is no device: name one"),
        (MODEM + GNSS.replace("/b", "/dev/serial/by-id/*"), "is no device: name one"),
        (MODEM + GNSS.replace("/b", "/b "), "'/b ' is no device: name one"),
        (MODEM + GNSS + '[status]\nled = "/sys/class/leds/ACT"\n', '"led": the name of an LED'),
        (MODEM + GNSS.replace("/b", "gpsd://"), "'gpsd://' is no device: name one"),
        (MODEM + GNSS + MORE.replace("[[source]]", "[source]"), "two brackets: [[source]]"),
        (MODEM + 'set_mode = "GSM"\n' + GNSS, "invalid enum value 'GSM'; valid: \"gsm\""),
        (MODEM + GNSS + '[live]\nreach = "wide"\n', 'valid: "any", "near", "far"'),
        ("source = 3\n" + MODEM + GNSS, '"source": expected `array`, got `int`'),
        ("source = [3]\n" + MODEM + GNSS, "[[source]] 1 expected `object`, got `int`"),
    ],
)
def test_sources_that_cannot_work_are_one_line(tables, says):
    text = SITE + tables if not tables.startswith("source") else tables + SITE
    with pytest.raises(ConfigError) as error:
        parse_config(text, "site.toml")
    assert says in str(error.value)


OWN_NAMES = ["strongest", "suspicious", "262-01-801-86355", "LTE-5780-210"]


@pytest.mark.parametrize(
    ("table", "key", "valid", "invalid"),
    [
        ("status", "feed", ["", "/run/x.sock", "1024", "65535"], ["80", "65536", "99999", "x"]),
        ("live", "target", OWN_NAMES, ["strongest ", "26201-6699-15437", "262-1-801-86355"]),
        ("run", "directory", ["runs"], [""]),
    ],
)
def test_what_no_run_could_use_is_said_before_it(table, key, valid, invalid):
    for value in (*valid, *invalid):
        text = f'[{table}]\n{key} = "{value}"\n' + (SITE if table != "run" else "") + MODEM + GNSS
        if value in valid:
            parse_config(text, "site.toml")
        else:
            with pytest.raises(ConfigError, match=rf'\[{table}\] "{key}"'):
                parse_config(text, "site.toml")


def test_a_byte_order_mark_as_windows_writes_it_is_no_error(tmp_path):
    file = tmp_path / "site.toml"
    file.write_text(SITE + MODEM + GNSS, encoding="utf-8-sig")
    assert load_config(file)[0].run.directory == "r"


@pytest.mark.parametrize("whole", ["", SITE])
def test_a_file_that_a_power_cut_left_as_zeros_is_to_be_written_anew(tmp_path, whole):
    file = tmp_path / "site.toml"
    file.write_text(whole + "\0" * 5000)
    with pytest.raises(ConfigError, match="write it anew"):
        load_config(file)


def _message_of(capsys):
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1, lines
    return lines[0]


@pytest.mark.parametrize(("table", "key", "value"), NO_MEANING)
def test_a_value_without_a_meaning_is_one_line_that_names_the_key(
    tmp_path, capsys, table, key, value
):
    wanted = {name: {k: json.dumps(v) for k, v in values.items()} for name, values in WELL.items()}
    wanted.setdefault(table, {})[key] = value
    wanted["run"].setdefault("directory", json.dumps(str(tmp_path / "runs")))
    text = "\n".join(
        f"[{t}]\n" + "\n".join(f"{k} = {v}" for k, v in vs.items()) for t, vs in wanted.items()
    )
    tomllib.loads(text)
    (tmp_path / "site.toml").write_text(text)
    for command in ("check", "run"):
        assert main([command, "--config", str(tmp_path / "site.toml")]) == 2
        said = _message_of(capsys)
        assert f'[{table}] "{key}"' in said
    assert not (tmp_path / "runs").exists()


NO_PORTS = [
    "hwgrep://(((((", "hwgrep://x&n=q", "hwgrep://x&bogus", "socket://h:99999", "socket://h",
    "socket://", "socket://[::1", "socket://h:abc", "SOCKET://h:99999", "rfc2217://h:99999",
    "gpsd://h:99999", "gpsd://[::1", "nope://x",
    "://", "/dev/\0tty", "\0", "a.b://c", "alt://x?class=Nothing",
]  # fmt: skip


@pytest.mark.parametrize("port", NO_PORTS)
def test_a_port_that_can_never_be_opened_is_one_line(tmp_path, capsys, port):
    path = service.site_toml(tmp_path, "/dev/ttyUSB77", "/dev/ttyUSB78")
    path.write_text(path.read_text().replace('"/dev/ttyUSB77"', _string(port)))
    for command in ("check", "run"):
        assert main([command, "--config", str(path)]) == 2
        assert "port" in _message_of(capsys)


def test_a_port_that_is_searched_for_may_be_plugged_in_later():
    check_url("hwgrep://1e0e:9001")


@pytest.mark.parametrize(
    "directory", ["~nouser-of-this-name/x", "a\0b", "/proc/none/x", "/" + "x" * 300]
)
def test_a_directory_that_cannot_be_is_one_error(directory):
    with pytest.raises(ConfigError, match="directory"):
        usable_folder(directory)


def test_a_directory_that_is_a_dangling_link_says_so(tmp_path):
    (tmp_path / "runs").symlink_to(tmp_path / "usb")
    with pytest.raises(ConfigError, match=f"link to {tmp_path / 'usb'}, which is missing"):
        usable_folder(str(tmp_path / "runs"))


NASTY = ["a\0b", "/dev/null/x", "x" * 5000, "\x1b[2J", "/", "", "~nouser/x", "\udcff", "a\nb"]


@pytest.mark.parametrize("name", NASTY)
@pytest.mark.parametrize(
    "command",
    [
        ("run", "--config"),
        ("check", "--config"),
        ("doctor", "--config"),
        ("recover",),
        ("parse",),
        ("simulate", "--duration", "1", "--out"),
        ("probe",),
    ],
    ids=lambda command: command[0],
)
def test_a_nasty_name_is_one_line(tmp_path, monkeypatch, capsys, command, name):
    monkeypatch.chdir(tmp_path)
    if command[0] in {"simulate", "recover"} and name in {
        "",
        "/",
        "\x1b[2J",
        "a\nb",
        "\udcff",
        "~nouser/x",
    }:
        pytest.skip("a folder may be called so")
    assert main([*command, name]) == 2
    if command[0] != "probe":
        _message_of(capsys)


@pytest.mark.parametrize("value", ["nan", "inf", "-1", "0", "1e300", "x", ""])
@pytest.mark.parametrize(
    ("option", "command"),
    [
        ("--duration", ("run", "--config", "none.toml")),
        ("--seconds", ("doctor",)),
        ("--duration", ("simulate",)),
        ("--speed", ("simulate",)),
    ],
)
def test_a_number_without_a_meaning_is_one_line_that_names_the_option(
    capsys, command, option, value
):
    assert main([*command, f"{option}={value}"]) == 2
    assert option in _message_of(capsys)


def test_a_target_of_channel_and_code_is_checked():
    def text(target):
        return "\n".join(
            f"[{table}]\n" + "\n".join(f"{key} = {_toml(value)}" for key, value in values.items())
            for table, values in (WELL | {"live": {"target": target}}).items()
        )

    assert parse_config(text("LTE-5780-210"), "site.toml").live.target == "LTE-5780-210"
    with pytest.raises(ConfigError, match="the PCI at most 503") as error:
        parse_config(text("LTE-5780-504"), "site.toml")
    assert "\n" not in str(error.value)
