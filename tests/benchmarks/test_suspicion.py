"""The measured rates hold: a rule that accuses more legitimate cells than stated fails here."""

import gzip
from contextlib import closing
from dataclasses import replace
from math import inf

import pytest

from benchmarks.suspicion import NOT_RATED, ON_AIR_S, Counts, count, without_entry
from benchmarks.suspicion_baseline import baseline_of, logs_with_baseline
from benchmarks.suspicion_city import city_log
from benchmarks.suspicion_gone import summary_of
from benchmarks.suspicion_injection import Station, detect, inject, outcomes
from benchmarks.suspicion_logs import LOGS, Log, read_log, read_logs
from benchmarks.suspicion_patterns import COPIES, ORDINARY
from benchmarks.suspicion_takeover import CORPUS, full_scans, takeovers
from logger.core.baseline import NO_BASELINE
from logger.core.suspicion.rules import RULES
from logger.core.suspicion.words import WORD_RATES
from logger.core.types import Scan
from logger.sim.scenario import GRAZ
from tests.kit.street import CELLS, N_SCANS, STEP_S, street
from tests.kit.suspicion_walks import gsm

HOURS = N_SCANS * STEP_S / 3600.0
STREET = Log("simulated", street(), HOURS)

needs_logs = pytest.mark.skipif(not LOGS.is_dir(), reason=f"there are no logs in {LOGS}")


def test_a_log_is_read_by_scans_with_its_hours(tmp_path):
    header = "t_s,lat,lon,rat,mcc,mnc,lac_tac,cid,arfcn,pci_bsic,level_dbm,serving,ta"
    rows = [
        f"{1598796851 + k},45.41{k},-75.69,GSM,302,720,1,{cid},{arfcn},,-70,{serving},"
        for k in range(1, 4)
        for cid, arfcn, serving in ((51, 62, 1), (52, 64, 0))
    ]
    path = tmp_path / "ottawa_1.csv.gz"
    path.write_bytes(gzip.compress("\n".join([header, *rows]).encode()))
    log = read_log(path)
    scans = [record.value for record in log.records if isinstance(record.value, Scan)]
    assert [[reading.cid for reading in scan.readings] for scan in scans] == [[51, 52]] * 3
    assert (log.set_name, log.hours * 3600.0) == ("ottawa", pytest.approx(2.0))


@needs_logs
@pytest.mark.slow
def test_the_rates_on_legitimate_logs_are_those_that_the_program_states():
    counts = count(log for log in read_logs() if log.set_name not in NOT_RATED)
    for rule in RULES.values():
        for rat, rate in rule.measured.items():
            keys = [key for key in counts.exposed if (key[0], key[2]) == (rule.id, rat)]
            assert sum(counts.alarms[key] for key in keys) <= rate.alarms, (rule.id, rat)
            hours = sum(counts.exposed_hours[key] for key in keys)
            assert hours == pytest.approx(rate.hours, abs=0.06), (rule.id, rat)
    for word, rate in WORD_RATES.items():
        assert sum(n for (name, _), n in counts.words.items() if name == word) <= rate.alarms
        assert sum(counts.hours.values()) == pytest.approx(rate.hours, abs=0.06)
    assert counts.words["suspicious", "india_gsm"] == counts.words["suspicious", "ottawa"] == 0


@needs_logs
@pytest.mark.slow
def test_a_baseline_of_ten_walks_adds_no_suspicious_cell():
    counts = Counts()
    for log, baseline in logs_with_baseline(LOGS, 10, ["ottawa_lacolyoc"]):
        counts.add(log, baseline)
    alarms = sum(n for (rule, _, _), n in counts.alarms.items() if rule == "B1")
    assert alarms <= RULES["B1"].elsewhere.alarms
    assert not counts.suspicious


def test_a_clean_city_has_no_suspicious_cell_and_its_rogue_has():
    clean, rogue = Counts(), Counts()
    clean.add(city_log(1))
    rogue.add(city_log(1, (GRAZ.rogue,)))
    assert not clean.suspicious
    assert [text.split()[2] for text in rogue.suspicious] == ["232-01-7777-4660"]


@pytest.mark.parametrize("kind", ["invented identity", "new area"])
def test_a_strong_station_that_breaks_plan_or_area_is_named_in_time(kind):
    injected = inject(city_log(3), Station(kind, True))
    assert detect(injected).in_time == "suspicious"


def test_a_channel_taken_over_beside_a_standing_receiver_is_named():
    """Of six simulated cells; with ../shared/corpus those that real modems listed."""
    cells = tuple(replace(gsm(cid, -80 - 5 * (cid % 5)), role="scan") for cid in range(10, 16))
    results = list(takeovers([cells, *(full_scans() if CORPUS.is_dir() else [])[:2]]))
    assert {result.period_s for result in results} == {10.0, 30.0, 60.0}
    assert {result.in_time for result in results} == {"suspicious"}
    assert {result.clean for result in results} == {"nothing unusual"}


@pytest.mark.parametrize(
    ("kind", "strong", "on_air_s"),
    [
        *(("invented identity", True, on_air_s) for on_air_s in (inf, ON_AIR_S)),
        *(("new area", strong, on_air_s) for strong in (True, False) for on_air_s in (inf, 60.0)),
        *(("downgrade", strong, on_air_s) for strong in (True, False) for on_air_s in (inf, 60.0)),
        ("clone on its channel", True, inf),
        ("clone on another channel", True, inf),
        ("perfect copy", True, inf),
    ],
)
def test_a_station_beside_a_street_is_suspicious(kind, strong, on_air_s):
    """A twin of each target, of one drive: clones are passed as well as their originals."""
    injected = inject(STREET, Station(kind, strong, on_air_s))
    assert injected.is_passed == (kind in COPIES)
    assert detect(injected).at_end.word == "suspicious"


def test_a_street_without_a_station_has_no_suspicious_cell():
    counts = count([STREET, Log("GSM", street("GSM"), HOURS)])
    assert not counts.suspicious


def test_neighbours_by_channel_and_code_that_are_legitimate_are_not_suspicious():
    records = [
        replace(one, value=replace(one.value, readings=tuple(map(_nameless, one.value.readings))))
        if isinstance(one.value, Scan)
        else one
        for one in STREET.records
    ]
    counts = count([Log("simulated", Log("", records, HOURS).by_channel.records, HOURS)])
    assert counts.cells["simulated"] == len(CELLS)
    assert not counts.suspicious


def _nameless(reading):
    return replace(reading, cid=None, tac=None)


@pytest.fixture(scope="module")
def drives(tmp_path_factory):
    """Earlier drives along the street, each as a baseline stores it."""
    folder = tmp_path_factory.mktemp("drives")
    return [summary_of(street(seed=seed), folder / f"{seed}") for seed in range(1, 16)]


@pytest.mark.parametrize(
    ("n_walks", "strong", "word"),
    [
        (0, True, "nothing unusual"),
        (3, True, "nothing unusual"),
        (10, True, "suspicious"),
        (10, False, "unusual"),
        (15, True, "suspicious"),
        (15, False, "suspicious"),
    ],
)
def test_earlier_walks_show_an_ordinary_catcher(drives, tmp_path, n_walks, strong, word):
    with closing(baseline_of(tmp_path / "b.db", drives[:n_walks])) as baseline:
        injected = inject(STREET, Station(ORDINARY, strong))
        assert detect(injected, baseline=baseline).at_end.word == word
        counts = Counts()
        counts.add(STREET, baseline)
        assert not counts.suspicious


def test_a_database_that_has_most_cells_helps_against_an_ordinary_catcher():
    (outcome,) = outcomes(STREET, NO_BASELINE, [Station(ORDINARY, True)])
    scores = [without_entry(outcome.at_end, n_known).score_nats for n_known in (60, 90)]
    assert scores[0] < scores[1] == pytest.approx(outcome.at_end.score_nats + 2.0)
