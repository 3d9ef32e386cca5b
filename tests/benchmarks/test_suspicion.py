"""The measured rates hold: a rule that accuses more legitimate cells than stated fails here."""

import pytest

from benchmarks.suspicion import NOT_RATED, Counts, count
from benchmarks.suspicion_baseline import logs_with_baseline
from benchmarks.suspicion_city import city_log
from benchmarks.suspicion_injection import detect, inject
from benchmarks.suspicion_logs import LOGS, read_logs
from logger.core.suspicion.rules import RULES
from logger.core.suspicion.words import WORD_RATES
from logger.sim.city import GRAZ

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
    rogue.add(city_log(1, (GRAZ.rogue,)))
    assert not clean.suspicious
    assert [text.split()[2] for text in rogue.suspicious] == ["232-01-7777-4660"]


@pytest.mark.parametrize("kind", ["invented identity", "new area"])
def test_a_strong_station_that_breaks_plan_or_area_is_named_in_time(kind):
    injected = inject(city_log(3), kind, strong=True, seed=0)
    assert detect(injected).in_time == "suspicious"
