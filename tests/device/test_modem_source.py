"""The real service on real ptys: every family of modems, and modems that misbehave."""

import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from datetime import timedelta
from itertools import pairwise

import pytest

from logger.config import parse_config
from logger.core.runfile import read_run
from logger.device import link, modem_source
from logger.device.clock import Clock, ScaledClock
from logger.device.modem_source import ModemSource
from logger.device.service import Service
from logger.device.startup import begin_run
from logger.drivers import family
from logger.drivers.registry import FAMILIES
from logger.sim.dialects import identity_replies
from logger.sim.faults import FAULTS, Misbehaving
from logger.sim.ptys import PtyDevice, answering
from logger.sim.scenario import scenario
from logger.sim.walk import WalkTime
from tests.kit import service
from tests.kit.dialects import DIALECTS
from tests.kit.recorded_runs import RecordedRun, make_service, record_until, recording

BLOCK = scenario("clear")
CELLS = {(t.mcc, t.mnc, t.lac, t.cid) for t in BLOCK.world.transmitters}
AREAS_AND_CELLS = {(lac, cid) for _, _, lac, cid in CELLS}

SPEED = 20.0
FAMILY = {
    "sim800": "sim800", "sim808": "sim800", "sim7000": "sim7000", "sim7600": "sim7600",
    "ec25": "quectel",
    "m95": "quectel_gsm", "ge864": "telit", "sara-g350": "ublox", "bgs2": "cinterion",
    "mc55": "cinterion",
    "tc63": "cinterion", "mc7455": "sierra", "me909s": "huawei", "l850": "fibocom",
    "plain": "generic",
}  # fmt: skip
SURVEYED = {"sim800", "sim808", "ec25", "ge864", "sara-g350"}
"""Modems that have a full scan of cells; that of the others is one of networks."""
NAMELESS = {"ge864", "mc7455", "me909s", "l850", "bgs2", "plain"}
"""Modems that tell the whole identity of the serving cell only."""

FAULT_S = (3.0, 7.0)
RECOVERED_S = 60.0
"""Some ten on an idle machine, and less than any full scan may take by its manual."""
EVENTS = {
    "garbage": {"garbage"},
    "hang": {"no-answer"},
    "stall": {"no-answer"},
    "brown-out": {"modem-restarted"},
    "silent-reset": {"modem-restarted"},
    "echo": {"modem-restarted"},
    "slow": {"slow-answer", "no-answer"},
    "duplicated": {"repeated-lines"},
    "repeated": {"stray-result"},
    "urc-storm": {"unasked-lines"},
    "unplug": {"port-lost"},
}


IN_A_SCAN = "brown-out in a full scan"


def _walk(folder, name) -> RecordedRun:
    """A short walk with one modem at many times the speed."""
    clock = ScaledClock(SPEED)
    walk_time = WalkTime(clock)
    with PtyDevice(answering(BLOCK.modem(walk_time.now_s, DIALECTS[name]))) as port:
        under_way = make_service(folder / name, clock, port.path, 70.0, 0.05 * SPEED)
        under_way.start()
        record_until(under_way, clock, lambda walked: _has_shown_all(walked, name))
        return RecordedRun(read_run(under_way.stop("end")))


def _has_shown_all(walked, name) -> bool:
    """Whether a walk is long enough for all that is looked at below."""
    scans = [readings for _, readings in walked.scans() if readings]
    named = {
        reading.cell for readings in scans for reading in readings if reading.role != "scan"
    } - {None}
    surveys = [n for n, readings in enumerate(scans) if readings[0].role == "scan"]
    polls = [n for n, readings in enumerate(scans) if readings[0].role == "serving"]
    surveyed = "full-scan" in walked.notes() or not FAMILIES[FAMILY[name]].survey_commands
    if name in SURVEYED:
        surveyed = len(surveys) >= 2 and any(surveys[0] < n < surveys[-1] for n in polls)
    return len(polls) > 5 and surveyed and len(named) >= (1 if name in NAMELESS else 6)


@pytest.fixture(scope="module")
def walks(tmp_path_factory):
    folder = tmp_path_factory.mktemp("walks")
    with ThreadPoolExecutor(len(DIALECTS)) as pool:
        return dict(
            zip(DIALECTS, pool.map(lambda name: _walk(folder, name), DIALECTS), strict=True)
        )


def test_there_is_a_modem_for_every_family():
    assert set(FAMILY) == set(DIALECTS)
    assert set(FAMILY.values()) == set(FAMILIES)


@pytest.mark.parametrize("name", DIALECTS)
def test_modem_is_identified_and_set_up(walks, name):
    assert any(text.endswith(f"driver {FAMILY[name]}") for text in walks[name].texts()), walks[
        name
    ].texts()
    assert walks[name].notes().count("modem-ready") == 1
    assert not {"no-answer", "setup-refused", "internal", "garbage"} & set(walks[name].notes())
    assert ("unknown-model" in walks[name].notes()) == (FAMILY[name] == "generic")


@pytest.mark.parametrize("name", DIALECTS)
def test_cells_are_those_of_the_world(walks, name):
    readings = [reading for _, scan in walks[name].scans() for reading in scan]
    assert all(_is_of_the_world(reading) for reading in readings)
    named = {reading.cell for reading in readings if reading.role != "scan"} - {None}
    assert len(named) >= (1 if name in NAMELESS else 6)
    serving = [scan[0] for _, scan in walks[name].scans() if scan and scan[0].role == "serving"]
    assert len(serving) > 5
    # a cell may change between the two commands that name it, and the stop may cut the last poll
    changes = sum(one.cid != other.cid for one, other in pairwise(serving))
    assert sum(reading.cell is None for reading in serving) <= changes + 1


def _is_of_the_world(reading) -> bool:
    area = reading.tac if reading.lac is None else reading.lac
    if reading.cid is not None and (area, reading.cid) not in AREAS_AND_CELLS:
        return False
    return reading.cell is None or (reading.mcc, reading.mnc, area, reading.cid) in CELLS


@pytest.mark.parametrize("name", DIALECTS)
def test_full_scans_are_between_polls(walks, name):
    kinds = [scan[0].role for _, scan in walks[name].scans() if scan]
    surveys = [i for i, kind in enumerate(kinds) if kind == "scan"]
    assert (len(surveys) >= 2) == (name in SURVEYED)
    if surveys:
        assert "serving" in kinds[surveys[0] : surveys[-1]]
    assert ("full-scan" in walks[name].notes()) == bool(FAMILIES[FAMILY[name]].survey_commands)
    assert "unread-rows" not in walks[name].notes()


@pytest.mark.parametrize("name", DIALECTS)
def test_nothing_of_the_raw_bytes_tells_who_the_device_is(walks, name):
    assert b"00499901" not in walks[name].run.raw_bytes.tobytes()


@pytest.mark.parametrize(
    ("maker", "model", "driver"),
    [
        ("SIMCOM_Ltd", "SIMCOM_SIM5300E", "sim7600"),
        ("Quectel_Ltd", "Quectel_UC15", "quectel"),
        ("Sierra Wireless, Inc.", "MC8705", "sierra"),
        ("Telit", "ME50G1-WW", "telit"),
    ],
)
def test_a_modem_that_lacks_the_commands_of_its_family_has_its_serving_cell(
    tmp_path, maker, model, driver
):
    clock = ScaledClock(SPEED)
    identity = identity_replies([model], maker, model, "1.0")
    modem = BLOCK.modem(WalkTime(clock).now_s, replace(DIALECTS["plain"], identity=identity))
    with PtyDevice(answering(modem)) as port:
        under_way = make_service(tmp_path, clock, port.path, 0.0, 1.0)
        under_way.start()
        record_until(under_way, clock, lambda walked: len(walked.scans()) > 5)
        walked = RecordedRun(read_run(under_way.stop("end")))
    assert any(text.endswith(f"driver {driver}") for text in walked.texts())
    readings = [reading for _, scan in walked.scans() for reading in scan]
    assert {reading.cell for reading in readings} & {"-".join(map(str, cell)) for cell in CELLS}
    assert all(map(_is_of_the_world, readings))
    n_without = sum(reading.level_dbm is None for reading in readings)
    assert n_without <= 1, "the stop may cut the last poll"
    assert "standard-replies" in walked.notes()
    assert "poll-refused" not in walked.notes()


@pytest.mark.parametrize("name", ["sim808", "sim7600", "ec25"])
def test_the_receiver_of_the_modem_gives_the_fixes(tmp_path, name):
    clock = ScaledClock(SPEED)
    walk_time = WalkTime(clock)
    with PtyDevice(answering(BLOCK.modem(walk_time.now_s, DIALECTS[name]))) as port:
        under_way = make_service(tmp_path, clock, port.path, 0, 1.0, gnss="modem")
        under_way.start()
        record_until(under_way, clock, lambda walked: walked.run.tables["fixes"]["valid"].sum() > 5)
        run = read_run(under_way.stop("end"))
    fixes = run.tables["fixes"]
    found = fixes[fixes["valid"] == 1]
    assert len(found) > 5
    for fix in found:
        east_m, north_m = BLOCK.world.to_local(fix["lat_deg"], fix["lon_deg"])
        t_s = fix["utc_ns"] / 1e9 - BLOCK.utc_start.timestamp()
        assert BLOCK.walk.position(t_s) == pytest.approx((east_m, north_m), abs=2.0)


def test_the_receiver_of_a_modem_without_a_position_or_switched_off_is_told_of(
    tmp_path, monkeypatch
):
    monkeypatch.setattr(link, "NOTE_INTERVAL_S", 0.5)
    modem = Locked("AT+QGPSLOC=2", "+CME ERROR: 516", DIALECTS["ec25"])
    with (
        PtyDevice(answering(modem)) as port,
        recording(make_service(tmp_path, Clock(), port.path, 0, 0.1, "modem")) as under_way,
    ):
        service.wait_for(lambda: under_way.snapshot().fix is not None)
        assert not under_way.snapshot().fix.valid
        modem.refuse("AT+QGPSLOC=2", "+CME ERROR: 505")
        says = "receiver said nothing (AT+QGPSLOC=2: +CME ERROR: 505)"
        service.wait_for(lambda: says in under_way.snapshot().ports["modem"].event)


@pytest.mark.parametrize(("model", "is_told"), [("SIM7000E", False), ("SIM7080G", True)])
def test_a_model_that_may_hear_no_cells_beside_its_receiver_is_told_of(tmp_path, model, is_told):
    clock = ScaledClock(SPEED)
    identity = identity_replies([f"{model} R1351"], "SIMCOM_Ltd", f"SIMCOM_{model}", "1.0")
    modem = BLOCK.modem(WalkTime(clock).now_s, replace(DIALECTS["sim7000"], identity=identity))
    with PtyDevice(answering(modem)) as port:
        under_way = make_service(tmp_path, clock, port.path, 0, 1.0, gnss="modem")
        under_way.start()
        record_until(under_way, clock, lambda walked: len(walked.run.tables["fixes"]) > 1)
        run = RecordedRun(read_run(under_way.stop("end")))
    assert ("receiver-or-cells" in run.notes()) == is_told


def test_a_date_before_a_rollover_is_noted_once(tmp_path):
    clock = ScaledClock(SPEED)
    early = replace(BLOCK, utc_start=BLOCK.utc_start - timedelta(weeks=1024))
    with PtyDevice(answering(early.modem(WalkTime(clock).now_s, DIALECTS["sim808"]))) as port:
        under_way = make_service(tmp_path, clock, port.path, 0, 1.0, gnss="modem")
        under_way.start()
        record_until(under_way, clock, lambda walked: walked.run.tables["fixes"]["valid"].sum() > 5)
        run = RecordedRun(read_run(under_way.stop("end")))
    assert run.notes().count("impossible-date") == 1
    assert any(str(early.utc_start.date()) in text for text in run.texts())


class Story:
    """Time of a fault: it stands before the begin until that is told to come."""

    def __init__(self, start_s: float) -> None:
        self._start_s = start_s
        self._began_s: float | None = None

    def __call__(self) -> float:
        if self._began_s is None:
            return 0.0
        return self._start_s + time.monotonic() - self._began_s

    def begin(self) -> None:
        self._began_s = time.monotonic()


def _misbehave(folder, fault, during_s=FAULT_S, name="sim800", scan: bytes = b"") -> RecordedRun:
    """A walk in real time: some whole scans (or the begin of a full one), a fault, and whole scans
    again.
    """
    clock = Clock()
    story = Story(during_s[0])
    modem = BLOCK.modem(WalkTime(clock).now_s, DIALECTS[name])
    session = answering(modem if fault == "unplug" else Misbehaving(modem, fault, *during_s, story))
    folder.mkdir(parents=True, exist_ok=True)
    with PtyDevice(session, folder / "modem") as port:
        under_way = make_service(folder, clock, port.path, 600.0 if scan else 0.0, 0.1)
        under_way.start()
        record_until(
            under_way,
            clock,
            lambda walked: scan in _commands_of(walked) if scan else len(walked.scans()) > 10,
        )
        start_s = clock.now_ns() / 1e9
        if fault == "unplug":
            port.unplug()
            modem.restart()
            time.sleep(during_s[1] - during_s[0])
            port.plug()
        else:
            story.begin()
        end_s = start_s + during_s[1] - during_s[0]

        def is_well(walked):
            return len(_whole_again(RecordedRun(walked.run, start_s, end_s))) > 10

        record_until(under_way, clock, is_well)
        return RecordedRun(read_run(under_way.stop("end")), start_s, end_s)


def _commands_of(walked) -> bytes:
    raw = walked.run.tables["raw"]
    return walked.run.bytes_of(raw[raw["sent"] != 0])


@pytest.fixture(scope="module")
def faulty_walk(tmp_path_factory):
    folder = tmp_path_factory.mktemp("faults")
    with ThreadPoolExecutor(len(EVENTS) + 1) as pool:
        under_way = {fault: pool.submit(_misbehave, folder / fault, fault) for fault in EVENTS}
        under_way[IN_A_SCAN] = pool.submit(
            _misbehave, folder / "scan", "brown-out", (1.0, 3.0), scan=b"AT+CNETSCAN\r"
        )
        return {fault: walked.result() for fault, walked in under_way.items()}


def _whole_again(walked: RecordedRun) -> list[float]:
    """Begins of the scans after the end of the fault from which on all are whole; the stop may cut
    the last one.
    """
    usual = min(
        (len(readings) for t_s, readings in walked.scans() if readings and t_s < walked.start_s),
        default=6,
    )
    begins: list[float] = []
    for t_s, readings in walked.scans()[:-1]:
        if t_s >= walked.end_s:
            begins = [*begins, t_s] if len(readings) >= usual else []
    return begins


def recovered_s(walked: RecordedRun) -> float:
    """Seconds from the end of the fault to the first scan after which all are whole."""
    return next(iter(_whole_again(walked)), float("inf")) - walked.end_s


def test_every_fault_is_tried():
    assert set(EVENTS) == {*FAULTS, "unplug"}


@pytest.mark.parametrize("fault", EVENTS)
def test_recovers_by_itself(faulty_walk, fault):
    walked = faulty_walk[fault]
    print(f"{fault}: recovered after {recovered_s(walked):.2f} s; {sorted(set(walked.notes()))}")
    assert recovered_s(walked) < RECOVERED_S, walked.texts()
    assert sum(t_s < walked.start_s for t_s, _ in walked.scans()) > 5


@pytest.mark.parametrize("fault", EVENTS)
def test_the_event_is_in_the_run(faulty_walk, fault):
    assert EVENTS[fault] & set(faulty_walk[fault].notes()), faulty_walk[fault].texts()
    assert "internal" not in faulty_walk[fault].notes()
    assert len(faulty_walk[fault].notes()) < 40


@pytest.mark.parametrize("fault", EVENTS)
def test_no_cell_is_invented(faulty_walk, fault):
    for _, readings in faulty_walk[fault].scans():
        assert all(_is_of_the_world(reading) for reading in readings)
        assert len(readings) == len(set(readings))


def test_a_restart_ends_a_full_scan(faulty_walk):
    """The command under way will never be answered, and its time is 90 s."""
    assert recovered_s(faulty_walk[IN_A_SCAN]) < RECOVERED_S
    assert "modem-restarted" in faulty_walk[IN_A_SCAN].notes()


LONG_S = (4.0, 30.0)
"""Long enough for the port to be opened again."""


@pytest.mark.slow
@pytest.mark.parametrize("fault", EVENTS)
def test_every_family_recovers_from_every_fault(tmp_path, fault):
    with ThreadPoolExecutor(len(DIALECTS)) as pool:
        walks = pool.map(lambda name: _misbehave(tmp_path / name, fault, LONG_S, name), DIALECTS)
        for name, walked in zip(DIALECTS, walks, strict=True):
            print(f"{fault} {name}: {recovered_s(walked):.2f} s")
            assert recovered_s(walked) < RECOVERED_S, walked.texts()
            # in so long a silence the port is opened again, which a restart that is not told of
            # cannot be told from
            assert (EVENTS[fault] | {"no-answer"}) & set(walked.notes()), walked.texts()
            assert all(
                _is_of_the_world(reading) for _, readings in walked.scans() for reading in readings
            )


EC25 = (
    '+QENG: "servingcell","NOCONN","GSM",262,01,1A2C,3C4D,21,57,0,-66,255,255,0,39,41,1'
    ',-,-,-,-,-,-,-,-,-,"-"'
)
CUTTERS = (
    '\r\n+QIND: "csq",20,99\r\n', '\r\n+CMTI: "SM",1\r\n', "\r\n^MODE: 5\r\n", "\r\nRING\r\n",
    "\r\n+CPIN: READY\r\n", "\r\nNO CARRIER\r\n", "\r\n+CREG: 5\r\n",
    '+CREG: 1,"0001","0002",0\r\n',
)  # fmt: skip


class Interrupting:
    """An EC25 of which one row in three is whole; a line stands in the others, at each place of
    `places` for each of `CUTTERS`.
    """

    def __init__(self, places):
        self._cuts = [(place, line) for place in places for line in CUTTERS]
        self.n_asked = self.n_cut = 0

    @property
    def is_over(self):
        return self.n_cut == len(self._cuts)

    def feed(self, data):
        return b"".join(self._reply(line.decode()) for line in data.split(b"\r") if line)

    def unsolicited(self):
        return b""

    def _reply(self, command):
        if command == "ATI":
            text = "Quectel\r\nEC25\r\nRevision: EC25EFAR06A06M4G\r\n"
        elif command == 'AT+QENG="servingcell"':
            text = f"{self._row()}\r\n"
        else:
            text = ""
        return f"\r\n{text}\r\nOK\r\n".encode()

    def _row(self):
        self.n_asked += 1
        if self.n_asked % 3 == 0 or self.is_over:
            return EC25
        place, line = self._cuts[self.n_cut]
        self.n_cut += 1
        return EC25[:place] + line + EC25[place:]


def test_a_poll_whose_row_was_cut_is_no_scan_without_cells(tmp_path):
    """Where the row cannot be read the poll is counted in a note, and no identity is wrong."""
    modem = Interrupting([28, 38, 46, 53, 61])
    clock = Clock()
    with PtyDevice(answering(modem)) as port:
        under_way = make_service(tmp_path, clock, port.path, 0.0, 0.01)
        under_way.start()
        record_until(under_way, clock, lambda walked: modem.is_over and len(walked.scans()) > 15)
        walked = RecordedRun(read_run(under_way.stop("end")))
    assert modem.is_over
    assert len(walked.scans()) > 15
    cells = [[reading.cell for reading in readings] for _, readings in walked.scans()]
    assert all(found == ["262-01-6700-15437"] for found in cells)
    levels = {reading.level_dbm for _, readings in walked.scans() for reading in readings}
    assert levels <= {-66.0, None}
    counted = [int(text.split()[0]) for text in walked.texts() if "had a row cut" in text]
    assert sum(counted) >= modem.n_cut


class Deaf:
    """A modem that answers nothing while `is_deaf`."""

    def __init__(self, dialect=DIALECTS["sim800"]):
        self._modem = BLOCK.modem(WalkTime(Clock()).now_s, dialect)
        self.is_deaf = True

    def feed(self, data):
        return b"" if self.is_deaf else self._modem.feed(data)

    def unsolicited(self):
        return b""


class Locked(Deaf):
    """A modem that refuses one command for the reason it gives."""

    def __init__(self, command, code, dialect=DIALECTS["sim800"]):
        super().__init__(dialect)
        self.refuse(command, code)

    def refuse(self, command, code):
        self._command, self._answer = f"{command}\r".encode(), f"\r\n{code}\r\n".encode()

    def feed(self, data):
        return self._answer if data == self._command else self._modem.feed(data)


@pytest.mark.parametrize(
    ("command", "code", "says"),
    [
        ("AT+CENG?", "+CME ERROR: 11", "refused (AT+CENG?: +CME ERROR: 11 (SIM PIN))"),
        ("AT+CENG?", "ERROR", "refused (AT+CENG?: ERROR)"),
        ("AT+CENG=1,1", "+CME ERROR: 10", "set-up (AT+CENG=1,1: +CME ERROR: 10 (no SIM))"),
    ],
)
def test_a_modem_that_refuses_is_told_of_with_its_reason(
    tmp_path, monkeypatch, command, code, says
):
    monkeypatch.setattr(link, "NOTE_INTERVAL_S", 0.5)
    clock = Clock()
    with (
        PtyDevice(answering(Locked(command, code))) as port,
        recording(make_service(tmp_path, clock, port.path, 0.0, 0.1)) as under_way,
    ):
        service.wait_for(lambda: says in under_way.snapshot().ports["modem"].event)


def test_cells_behind_a_repeated_result_are_no_poll_without_cells(tmp_path):
    """The modem answers OK twice: its rows come while the next command is pending."""
    modem = Locked("AT+CCINFO", "ERROR", DIALECTS["sim7600"])
    answer = modem.feed
    modem.feed = lambda data: b"\r\nOK\r\n" * (data == b"AT+CPSI?\r") + answer(data)
    clock = Clock()
    with PtyDevice(answering(modem)) as port:
        under_way = make_service(tmp_path, clock, port.path, 0.0, 0.1)
        under_way.start()
        record_until(under_way, clock, lambda walked: len(walked.scans()) > 9)
        walked = RecordedRun(read_run(under_way.stop("end")))
    assert len(walked.scans()) > 9
    assert all(readings for _, readings in walked.scans())
    assert "stray-result" in walked.notes()


def test_a_modem_that_never_hears_a_cell_is_a_fault_until_it_does(tmp_path):
    row = '+CENG: 0,"0000,00,00,000,00,00,0000,00,00,0000,00"'
    modem = Locked("AT+CENG?", f"+CENG: 1,1\r\n\r\n{row}\r\n\r\nOK")
    with (
        PtyDevice(answering(modem)) as port,
        recording(make_service(tmp_path, Clock(), port.path, 0.0, 0.1)) as under_way,
    ):
        service.wait_for(lambda: "antenna" in under_way.snapshot().ports["modem"].fault)
        assert under_way.snapshot().state == "error"
        modem.refuse("AT", "OK")
        service.wait_for(lambda: not under_way.snapshot().ports["modem"].fault)


def test_rows_in_an_unknown_form_are_a_fault_that_says_so(tmp_path, monkeypatch):
    monkeypatch.setattr(link, "NOTE_INTERVAL_S", 0.5)
    monkeypatch.setattr(ModemSource, "patience_s", 3.0)
    rows = "+GTCCINFO:\r\nLTE service cell:\r\n1,4,262,02,4E5F,2D3C4B5,5A4,12F,103"
    modem = Locked("AT+GTCCINFO?", f"{rows}\r\n\r\nOK", DIALECTS["l850"])
    others = {f"AT+{name}?\r".encode() for name in ("CREG", "CGREG", "CEREG", "C5GREG")}
    answer = modem.feed
    modem.feed = lambda data: b"\r\nOK\r\n" if data in others else answer(data)
    clock = Clock()
    with PtyDevice(answering(modem)) as port:
        under_way = make_service(tmp_path, clock, port.path, 0.0, 0.1)
        under_way.start()
        says = "rows of AT+GTCCINFO? in no form that driver fibocom reads"
        service.wait_for(lambda: says in under_way.snapshot().ports["modem"].fault)
        walked = RecordedRun(read_run(under_way.stop("end")))
    assert "unread-rows" in walked.notes()
    assert not walked.scans()


def test_rows_in_an_unknown_form_beside_readable_ones_are_recorded_and_cost_no_cell(tmp_path):
    serving = '+QENG: "servingcell","NOCONN","GSM",262,02,4E5F,3C4D,21,57,0,-66,255,255,0,39,41,1'
    serving += ',-,-,-,-,-,-,-,-,-,"-"'
    unknown = '+QENG: "neighbourcell","5.5G",262,02,138,123,283'
    modem = Locked('AT+QENG="servingcell"', f"{serving}\r\n{unknown}\r\n\r\nOK", DIALECTS["ec25"])
    clock = Clock()
    with PtyDevice(answering(modem)) as port:
        under_way = make_service(tmp_path, clock, port.path, 0.0, 0.1)
        under_way.start()
        service.wait_for(lambda: under_way.snapshot().scans > 3)
        walked = RecordedRun(read_run(under_way.stop("end")))
    assert "unread-rows" in walked.notes()
    assert all(readings for _, readings in walked.scans())


def test_rows_of_a_full_scan_in_an_unknown_form_are_recorded_too(tmp_path, monkeypatch):
    monkeypatch.setattr(link, "NOTE_INTERVAL_S", 0.5)
    command = 'AT+QOPSCFG="scancontrol",0;+QOPS'
    modem = Locked(command, "+QOPS: 1,262,02,138,123,283,17\r\n\r\nOK", DIALECTS["ec25"])
    with (
        PtyDevice(answering(modem)) as port,
        recording(make_service(tmp_path, Clock(), port.path, 60.0, 0.1)) as under_way,
    ):
        says = f"rows of {command} in no form that driver quectel reads"
        service.wait_for(lambda: says in under_way.snapshot().ports["modem"].event)


def test_one_of_two_modems_that_hears_no_cell_is_a_fault(tmp_path):
    # it has no antenna, and the other hears some
    row = '+CENG: 0,"0000,00,00,000,00,00,0000,00,00,0000,00"'
    silent = Locked("AT+CENG?", f"+CENG: 1,1\r\n\r\n{row}\r\n\r\nOK")
    other = Locked("AT", "OK")
    with PtyDevice(answering(silent)) as one, PtyDevice(answering(other)) as two:
        text = (
            f'[run]\ndirectory = "{tmp_path}"\n[modem]\nport = "{two.path}"\n'
            f'poll_interval_s = 0.1\n[gnss]\nport = "{tmp_path / "none"}"\n'
            f'[[source]]\nkind = "modem"\nport = "{one.path}"\npoll_interval_s = 0.1\n'
        )
        config, clock = parse_config(text, "site.toml"), Clock()
        under_way = Service(config, begin_run(config, text, clock), clock, threading.Event())
        with recording(under_way):
            service.wait_for(lambda: "antenna" in under_way.snapshot().ports["modem2"].fault, 60)
            assert not under_way.snapshot().ports["modem"].fault


class Unreadable(Deaf):
    """A modem that sends noise while `is_deaf`, as one at another rate does."""

    def feed(self, data):
        return b"\0\x9b" * len(data) if self.is_deaf else super().feed(data)


def test_a_modem_that_becomes_unreadable_is_a_fault_that_says_what_to_look_at(
    tmp_path, monkeypatch
):
    monkeypatch.setattr(ModemSource, "patience_s", 3.0)
    modem, clock = Unreadable(), Clock()
    modem.is_deaf = False
    with (
        PtyDevice(answering(modem)) as port,
        recording(make_service(tmp_path, clock, port.path, 0.0, 0.1)) as under_way,
    ):
        record_until(under_way, clock, lambda walked: len(walked.scans()) > 1)
        modem.is_deaf = True
        record_until(under_way, clock, lambda walked: walked.notes().count("port-opened") > 2)
        service.wait_for(lambda: "no scan" in under_way.snapshot().ports["modem"].fault)
        assert "is it at 115200 baud" in under_way.snapshot().ports["modem"].fault
        modem.is_deaf = False
        record_until(under_way, clock, lambda walked: walked.notes().count("modem-ready") > 1)
        service.wait_for(lambda: not under_way.snapshot().ports["modem"].fault)


def test_scans_that_become_rare_stand_in_the_status(tmp_path, monkeypatch):
    """Another program may eat most answers."""
    monkeypatch.setattr(ModemSource, "patience_s", 6.0)
    modem, clock = Deaf(), Clock()
    modem.is_deaf = False
    with (
        PtyDevice(answering(modem)) as port,
        recording(make_service(tmp_path, clock, port.path, 0.0, 0.1)) as under_way,
    ):
        record_until(under_way, clock, lambda walked: len(walked.scans()) > 1)
        assert "only one scan" not in under_way.status()
        modem.is_deaf = True
        service.wait_for(lambda: "modem: only one scan in" in under_way.status())
        modem.is_deaf = False
        service.wait_for(lambda: "only one scan" not in under_way.status())


class BootedNow(Clock):
    """The clock of a machine that has just booted."""

    def __init__(self):
        self._boot_ns = super().now_ns()

    def now_ns(self):
        return super().now_ns() - self._boot_ns


@pytest.mark.parametrize("kind", [Clock, BootedNow])
def test_a_modem_that_never_answered_is_a_fault_while_its_port_is_open(tmp_path, monkeypatch, kind):
    """It may take its time after a boot."""
    monkeypatch.setattr(family, "AUTOBAUD_TRIES", 1)
    modem, clock, ports = Deaf(), kind(), []

    def is_open():
        ports.append(under_way.snapshot().ports["modem"])
        return ports[-1].is_open

    with (
        PtyDevice(answering(modem)) as port,
        recording(make_service(tmp_path, clock, port.path, 0.0, 0.1)) as under_way,
    ):
        record_until(under_way, clock, lambda walked: walked.notes().count("port-opened") > 1)
        service.wait_for(is_open)
        assert ("gives no answer" in ports[-1].fault) == (kind is Clock)
        modem.is_deaf = False
        record_until(under_way, clock, lambda walked: len(walked.scans()) > 1)
        assert not under_way.snapshot().ports["modem"].fault


def test_a_modem_that_falls_silent_is_a_fault_until_its_next_scan(tmp_path, monkeypatch):
    # not only in the second in which its port is closed
    monkeypatch.setattr(modem_source, "SILENT_POLLS", 1)
    modem, clock, ports = Deaf(), Clock(), []
    modem.is_deaf = False

    def is_open_again():
        ports.append(under_way.snapshot().ports["modem"])
        return ports[-1].is_open

    with (
        PtyDevice(answering(modem)) as port,
        recording(make_service(tmp_path, clock, port.path, 0.0, 0.1)) as under_way,
    ):
        record_until(under_way, clock, lambda walked: len(walked.scans()) > 1)
        modem.is_deaf = True
        service.wait_for(lambda: not is_open_again())
        assert "gives no answer" in ports[-1].fault
        service.wait_for(is_open_again)
        assert "gives no answer" in ports[-1].fault
        modem.is_deaf = False
        service.wait_for(lambda: not under_way.snapshot().ports["modem"].fault)
