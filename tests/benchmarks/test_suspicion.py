"""The measured rates hold: a rule that accuses more legitimate cells than stated fails here."""

import pytest

from benchmarks.suspicion import Counts, count, poisson95
from benchmarks.suspicion_baseline import logs_with_baseline
from benchmarks.suspicion_city import city_log
from benchmarks.suspicion_injection import detect, inject
from benchmarks.suspicion_logs import LOGS, read_logs
from logger.core.suspicion.rates import MEASURED, WORD_RATES
from logger.core.suspicion.rules import RULES
from logger.sim.city import ROGUE

needs_logs = pytest.mark.skipif(not LOGS.is_dir(), reason=f"there are no logs in {LOGS}")


def test_the_interval_of_a_poisson_count():
    assert poisson95(0) == pytest.approx((0.0, 2.996), abs=0.001)
    assert poisson95(10) == pytest.approx((4.795, 18.390), abs=0.001)


@needs_logs
@pytest.mark.slow
def test_the_rates_on_legitimate_logs_are_those_that_the_program_states():
    counts = count(read_logs())
    for rule, by_rat in MEASURED.items():
        for rat, rate in by_rat.items():
            alarms = sum(n for (name, _, r), n in counts.alarms.items() if (name, r) == (rule, rat))
            assert alarms <= rate.alarms, (rule, rat)
    for word, rate in WORD_RATES.items():
        assert sum(n for (name, _), n in counts.words.items() if name == word) <= rate.alarms
    assert counts.words["suspicious", "india_gsm"] == counts.words["suspicious", "ottawa"] == 0
    assert counts.words["suspicious", "cork_driving"] <= 3
    assert counts.words["unusual", "cork_driving"] / counts.hours["cork_driving"] <= 2.0
    assert counts.words["unusual", "cork_static"] / counts.hours["cork_static"] <= 0.3


@needs_logs
@pytest.mark.slow
def test_a_baseline_of_seven_walks_adds_no_suspicious_cell():
    counts = Counts()
    for log, baseline in logs_with_baseline(LOGS, 7, ["ottawa_lacolyoc"]):
        counts.add(log, baseline)
    exposed = sum(n for (rule, _, _), n in counts.exposed.items() if rule == "B1")
    alarms = sum(n for (rule, _, _), n in counts.alarms.items() if rule == "B1")
    assert (alarms, exposed) == (RULES["B1"].elsewhere.alarms, RULES["B1"].elsewhere.cells)
    assert not counts.suspicious


def test_a_clean_city_has_no_suspicious_cell_and_its_rogue_has():
    clean, rogue = Counts(), Counts()
    clean.add(city_log(1))
    rogue.add(city_log(1, (ROGUE,)))
    assert not clean.suspicious
    assert [text.split()[2] for text in rogue.suspicious] == ["232-01-7777-4660"]


@pytest.mark.parametrize("kind", ["invented identity", "new area"])
def test_a_strong_station_that_breaks_plan_or_area_is_named_in_time(kind):
    injected = inject(city_log(3), kind, strong=True, seed=0)
    assert detect(injected).in_time == "suspicious"
