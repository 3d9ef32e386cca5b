"""Settings in a run: what JSON cannot say comes back as what it stood for."""

import math

import msgspec
import pytest

from logger.core.live import live_prior
from logger.core.live_settings import LIMITS, LiveSettings
from logger.core.model.prior import prior_for
from logger.core.runfile import read_run
from logger.core.runfile.frames import Kind, encode
from logger.core.schema import SCHEMA_VERSION
from tests.kit import runs


def test_an_infinite_hysteresis_is_kept(tmp_path):
    runs.write_journal(
        tmp_path / "a.journal", runs.records(3), live=LiveSettings(hysteresis_db=math.inf)
    )
    assert read_run(tmp_path / "a.journal").meta.live == LiveSettings(hysteresis_db=math.inf)


@pytest.mark.parametrize("name", [name for name in LIMITS if name != "most_cells"])
@pytest.mark.parametrize("value", [math.inf, -math.inf, math.nan])
def test_runs_of_earlier_versions_with_a_null_are_read(tmp_path, name, value):
    """They took any number, and JSON has a null for these."""
    runs.write_journal(tmp_path / "a.journal", runs.records(3), live=LiveSettings(**{name: value}))
    assert b'"%s":null' % name.encode() in msgspec.json.encode(LiveSettings(**{name: value}))
    found = getattr(read_run(tmp_path / "a.journal").meta.live, name)
    assert found == (None if name in {"height_m", "within_walk_m"} else math.inf)


@pytest.mark.parametrize(
    "settings",
    [
        {"reach": "near", "antenna": "omni", "height_m": 5.0},
        {"reach": "far", "antenna": "sector", "height_m": 0.0},
        {"reach": "any", "antenna": "any", "height_m": None},
    ],
)
def test_reach_antenna_and_height_are_those_that_were_recorded(tmp_path, settings):
    runs.write_journal(tmp_path / "a.journal", runs.records(3), live=LiveSettings(**settings))
    recorded = read_run(tmp_path / "a.journal").meta.live
    assert {name: getattr(recorded, name) for name in settings} == settings
    assert live_prior(recorded) == prior_for("any", **settings)


def test_by_default_the_levels_weigh_reach_antenna_and_height():
    assert live_prior(LiveSettings()) == prior_for("any", reach="any", antenna="any")


@pytest.mark.parametrize("recorded", [None, {"target": "suspicious"}, {"lost_s": 20.0}])
def test_what_an_earlier_run_does_not_say_is_as_it_was_then(tmp_path, recorded):
    meta = msgspec.json.decode(msgspec.json.encode(runs.meta()))
    del meta["live"]
    meta |= {} if recorded is None else {"live": recorded}
    frame = encode(1, 0, Kind.META, msgspec.json.encode(meta), SCHEMA_VERSION)
    (tmp_path / "a.journal").write_bytes(frame)
    then = {"target": "strongest", "give_up_s": 0.0, "by_channel": False}
    assert read_run(tmp_path / "a.journal").meta.live == LiveSettings(**then | (recorded or {}))
