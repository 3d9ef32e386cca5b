import pytest

from logger.config import GpsdSettings, ModemSettings, NmeaSettings
from logger.core.runfile import read_run
from logger.core.types import CellReading, Fix, Note, Record, Scan
from logger.doctor.single_tests import run_lines
from logger.drivers.registry import FAMILIES
from tests.kit import runs

S = 10**9


def _of(tmp_path, records):
    path = tmp_path / "a.journal"
    path.unlink(missing_ok=True)
    runs.write_journal(path, records)
    return {line.what: line for line in run_lines(read_run(path))}


def test_the_end_of_a_run_is_evaluated(tmp_path):
    fix = [Record(t * S, "gnss", Fix(True, None, 52.0, 13.0, hdop=1.0)) for t in range(1, 61)]
    scan = [Record(t * S, "modem", Scan(t * S, (runs.reading(1, -70.0),))) for t in range(1, 61, 2)]
    good = _of(tmp_path, sorted(fix + scan, key=lambda record: record.t_ns))
    assert {line.state for line in good.values()} == {"ok"}
    assert "of 1 cells" in good["readings"].text
    bad = _of(
        tmp_path,
        [
            Record(S, "modem", Note("warning", "port-lost", "no such port")),
            Record(2 * S, "gnss", Fix(False)),
        ],
    )
    assert [bad[what].state for what in ("modem", "readings", "gnss")] == ["fail", "warn", "warn"]
    assert "no such port" in bad["modem"].text
    assert _of(tmp_path, [Record(S, "modem", Scan(0, ()))])["gnss"].state == "fail"


@pytest.mark.parametrize(
    ("receiver", "says"),
    [
        (NmeaSettings(name="gnss", port="/b"), "right port and baud?"),
        (GpsdSettings(name="gnss", port="gpsd://h"), "does gpsd run"),
        (ModemSettings(name="second", port="/b", fixes=True), "has this modem a receiver?"),
    ],
)
def test_without_a_fix_it_says_where_to_look(tmp_path, receiver, says):
    path = tmp_path / "a.journal"
    runs.write_journal(path, [Record(S, "modem", Scan(0, ()))])
    sources = [ModemSettings(name="modem", port="/a"), receiver]
    assert says in list(run_lines(read_run(path), sources=sources))[-1].text


def test_a_modem_that_gives_no_answer_is_said_to_give_none(tmp_path):
    notes = [Note("info", "port-opened", "/a opened"), Note("warning", "port-lost", "no answer")]
    for said, event in ((notes[:1], "/a opened"), ([*notes, notes[0]], "no answer")):
        records = [Record(S, "modem", note) for note in said]
        assert _of(tmp_path, records)["modem"].text == f"no scan; last event: {event}"


def _reception_of(rats, driver, *notes):
    ready = Note("info", "modem-ready", f"modem set up by driver {driver}")
    cells = [
        CellReading("serving", rat, "262", "01", 1, 1, arfcn=1, rssi_dbm=-70.0) for rat in rats
    ]
    scans = [Record(t * S, "modem", Scan(t * S, tuple(cells))) for t in range(2, 30)]
    return [Record(S, "modem", note) for note in (ready, *notes)] + scans


@pytest.mark.parametrize("driver", FAMILIES)
def test_the_advice_names_the_command_of_the_family(tmp_path, driver):
    line = _of(tmp_path, _reception_of(["LTE"], driver))["readings"]
    commands = [command.set_to(command.gsm_only) for command in FAMILIES[driver].mode_commands]
    assert line.state == "warn"
    assert "only LTE: a 2G catcher would not be recorded; " in line.text
    assert ('set_mode = "gsm"' in line.text) == bool(commands)
    assert all(command in line.text for command in commands)


@pytest.mark.parametrize(
    ("rats", "text"),
    [
        (["GSM"], None),
        (["LTE", "GSM"], None),
        ([None], None),
        (["LTE", "WCDMA"], "only LTE and WCDMA"),
        (["NR"], "only NR"),
    ],
)
def test_other_technologies_matter_only_without_gsm(tmp_path, rats, text):
    line = _of(tmp_path, _reception_of(rats, "sim7600"))["readings"]
    assert (line.state, text is None or text in line.text) == ("warn" if text else "ok", True)
    assert ("2G catcher" in line.text) == (text is not None)


def test_no_advice_on_gsm_only_after_the_modem_has_refused_it(tmp_path):
    refused = Note(
        "warning",
        "mode-unchanged",
        "the mode of the modem is not changed: the modem refuses AT+CNMP=13",
    )
    line = _of(tmp_path, _reception_of(["LTE"], "sim7600", refused))["readings"]
    assert line.text.endswith("the modem refuses AT+CNMP=13")


def test_one_of_two_modems_without_an_antenna_is_told(tmp_path):
    path = tmp_path / "a.journal"
    stream = [record for record in runs.records(30) if record.source != "logger"]
    stream += [Record(t * S + 9, "other", Scan(t * S, ())) for t in range(30)]
    runs.write_journal(path, sorted(stream, key=lambda record: record.t_ns))
    sources = [ModemSettings(name=name, port=f"/dev/{name}") for name in ("modem", "other")]
    lines = {line.what: line for line in run_lines(read_run(path), sources=sources)}
    assert lines["modem"].state == "ok"
    assert (lines["other"].state, "antenna connected" in lines["other"].text) == ("warn", True)
