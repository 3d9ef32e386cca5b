"""The measured rates hold: a rule that accuses more legitimate cells than stated fails here."""

from dataclasses import replace

import pytest

from benchmarks.suspicion import NOT_RATED, Counts, count
from benchmarks.suspicion_baseline import logs_with_baseline
from benchmarks.suspicion_city import city_log
from benchmarks.suspicion_injection import detect, inject
from benchmarks.suspicion_logs import LOGS, Log, read_logs
from benchmarks.suspicion_takeover import CORPUS, full_scans, takeovers
from logger.core.suspicion.rules import RULES
from logger.core.suspicion.words import WORD_RATES
from logger.core.types import CellReading, Fix, Record, Scan
from logger.sim.city import GRAZ
from tests.kit.suspicion_walks import gsm

needs_logs = pytest.mark.skipif(not LOGS.is_dir(), reason=f"there are no logs in {LOGS}")


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
    injected = inject(city_log(3), kind, strong=True, seed=0)
    assert detect(injected).in_time == "suspicious"


def test_a_channel_taken_over_beside_a_standing_receiver_is_named():
    """Of six simulated cells; with ../shared/corpus those that real modems listed."""
    cells = tuple(replace(gsm(cid, -80 - 5 * (cid % 5)), role="scan") for cid in range(10, 16))
    results = list(takeovers([cells, *(full_scans() if CORPUS.is_dir() else [])[:2]]))
    assert {result.period_s for result in results} == {10.0, 30.0, 60.0}
    assert {result.in_time for result in results} == {"suspicious"}
    assert {result.clean for result in results} == {"nothing unusual"}


def test_a_telephone_that_a_station_pushes_to_2g_is_named():
    lte = CellReading("serving", "LTE", "232", "01", tac=7, cid=2570, rsrp_dbm=-90.0)
    fix = Fix(True, lat_deg=47.07, lon_deg=15.44)
    records = [
        Record(round(t_s * 1e9), source, value)
        for t_s in range(600)
        for source, value in (("gnss", fix), ("modem", Scan(round(t_s * 1e9), (lte,))))
    ]
    injected = inject(Log("simulated", records, 600 / 3600), "downgrade", strong=True, seed=0)
    assert detect(injected).in_time == "suspicious"
    counts = count([Log("simulated", records, 600 / 3600)])
    assert not counts.suspicious
