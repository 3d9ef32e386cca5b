"""The table of all rules.

`detection` is an assumption: the share of rogue cells that break the rule among those that aim at
what it checks. `elsewhere` are counts on other logs than those of `rates`: full scans of 197 GSM
cells at nine places, 88 cells at one place, and walks with 165 and 251 located cells.
"""

from math import exp

from logger.core.suspicion.finding import Family, Need, Rate, Rule
from logger.core.suspicion.rates import MEASURED

_GSM = frozenset({"GSM"})
_ALL = frozenset({"GSM", "WCDMA", "LTE", "LTE-M", "NB-IoT", "NR"})
_FULL_SCANS = "full scans of 197 cells"
_FEWEST_MEASURED = 100
"""Cells from which on a technology has its own rate: below, 3/n says less than other logs."""

_FEWEST_ALARMS = 3
"""Alarms that show a rate by themselves."""


def _rule(
    name: str,
    family: Family,
    needs: tuple[Need, ...],
    gate: str,
    sentence: str,
    innocent: str,
    detection: float,
    elsewhere: tuple[int, int, str],
    *,
    rats: frozenset[str] = _ALL,
    only_warns: bool = False,
) -> Rule:
    return Rule(
        name, family, frozenset(needs), rats, gate, sentence, innocent, detection,
        Rate(*elsewhere), only_warns,
    )  # fmt: skip


_ROWS = (
    _rule(
        "P1", "plan", ("position", "country code"),
        "railways are named; a test network counts once 3 cells of this country were heard",
        "network {operator}: {why}",
        "borders, ships and aircraft, private networks",
        0.9, (0, 85, "88 cells at one place, 3 of a railway left out"),
    ),
    _rule(
        "P2", "plan", ("identity", "channel", "earlier walks"),
        "10 cells of the operator known on channels of earlier walks; only warns",
        "channel {channel} is none of the {channels} channels of this operator in earlier walks",
        "the operator has a new channel",
        0.5, (0, 0, "not measured"), only_warns=True,
    ),
    _rule(
        "P3", "plan", ("identity", "cell database"),
        "weighed by the share of cells here that the database has; never alone",
        "the database does not have this cell, but {share:.0%} of the others heard here",
        "databases are incomplete",
        1.0, (100, 197, "a database that had 41 to 58 % of 197 cells"),
    ),
    _rule(
        "P4", "plan", ("identity", "area code"),
        "both heard for 10 s, not within 10 s of a change of technology",
        "cell identity {cid} is heard in area {area} and in area {other_area}",
        "an operator has renumbered, or two areas meet and use the number twice",
        0.8, (0, 0, "not measured"),
    ),
    _rule(
        "P5", "plan", ("identity", "channel", "colour code", "position"),
        "each held for 10 s; within 300 m of each other one is 10 dB stronger",
        "channel {channel} with code {code} is also that of {other}, heard {apart_m} m away",
        "a telephone that prints the old identity with the new channel",
        0.5, (0, 0, "not measured"), rats=_GSM,
    ),
    _rule(
        "P6", "plan", ("identity", "channel", "colour code"),
        "each channel held for 10 s",
        "is heard on channel {channel} and on channel {other_channel}",
        "an operator has changed the channels during the walk",
        0.9, (0, 0, "not measured"), rats=_GSM,
    ),
    _rule(
        "L1", "area", ("identity", "area code", "level"),
        "for 20 s, on foot for 100 m or 80 s, with 3 other cells of the operator within 5 "
        "minutes; the cell at least -90 dBm",
        "area {area} is that of none of the {neighbours} other cells heard with it",
        "the border of two areas",
        0.8, (0, 197, _FULL_SCANS),
    ),
    _rule(
        "L2", "area", ("identity", "area code"),
        "10 cells of the operator heard, 3 of them after this one; not of a railway",
        "area {area} has this cell alone, of {cells} cells of the operator",
        "the border of two areas, an indoor cell",
        0.8, (1, 194, _FULL_SCANS + ", railways left out"),
    ),
    _rule(
        "L3", "area", ("identity", "area code", "position"),
        "standing for 60 s, the new area for 10 s, no cell of it heard before, another one of the "
        "same network was",
        "the area changed from {other_area} to {area} after {still_s} s of standing",
        "the border of two areas, a cell switched off",
        0.4, (0, 0, "not measured"),
    ),
    _rule(
        "L4", "area", ("identity", "position", "country code"),
        "rule P1 holds; 3 scans over 20 s, the cell at least -105 dBm",
        "network {operator} has no other cell here, after {seconds} s",
        "a ship or an aircraft, a private network",
        0.8, (0, 85, "88 cells at one place, 3 of a railway left out"),
    ),
    _rule(
        "N1", "neighbours", ("identity", "neighbours", "level"),
        "3 scans and 20 s, serving cell at least -90 dBm, a modem that gave neighbours before",
        "no neighbour was reported for {seconds} s at {level_dbm} dBm",
        "a cell under ground or far from others",
        0.7, (0, 21, "2 h of GSM in calls"), rats=_GSM,
    ),
    _rule(
        "N2", "neighbours", ("identity", "channel", "neighbour lists"),
        "8 cells of the operator identified",
        "none of the {listed} channels of its neighbour list was heard",
        "the walk was too short to hear them",
        0.4, (0, 194, _FULL_SCANS + ", railways left out"), rats=_GSM,
    ),
    _rule(
        "N3", "neighbours", ("identity", "channel", "level", "neighbour lists"),
        "the cell at least -90 dBm, 3 lists of other cells of the operator",
        "channel {channel} is in none of the {lists} neighbour lists of the operator",
        "a new cell, an indoor cell",
        0.7, (1, 197, _FULL_SCANS), rats=_GSM,
    ),
    _rule(
        "N4", "neighbours", ("identity", "channel", "neighbour lists"),
        "2 listed channels are another operator's, none its own; not where sites are shared",
        "its neighbour list names {listed} channels of {other_operator} and none of its own",
        "networks that share sites",
        0.2, (0, 196, _FULL_SCANS + ", a test station left out"), rats=_GSM,
    ),
    _rule(
        "S2", "signal", ("identity", "level", "position"),
        "3 readings at the new level, the walker within 30 m",
        "the level rose by {rise_db} dB within {seconds} s while the walker hardly moved",
        "a door, a car or a street corner between",
        0.4, (0, 0, "not measured"),
    ),
    _rule(
        "S3", "signal", ("identity", "level", "position"),
        "3 readings; 15 dB above what two scans of its network within 30 s and 120 m could have "
        "missed",
        "appears with {level_dbm} dBm where {limit_dbm} dBm could not be missed {seconds} s before",
        "a legitimate cell switched on, the exit of a tunnel",
        0.5, (0, 0, "not measured"),
    ),
    _rule(
        "S4", "signal", ("identity", "level", "position"),
        "3 readings 15 dB above earlier visits within 60 m or earlier walks within 150 m",
        "{level_dbm} dBm, where it had at most {best_dbm} dBm before",
        "an antenna was turned, another height or building",
        0.6, (5, 161, "161 surveyed cells"),
    ),
    _rule(
        "S8", "signal", ("identity", "level"),
        "3 readings of at least -70 dBm, 6 dB above 3 other cells heard in the 5 minutes before",
        "{level_dbm} dBm, where the best of {cells} other cells had {best_dbm} dBm",
        "a walk past the mast of a legitimate cell",
        0.6, (0, 0, "not measured"),
    ),
    _rule(
        "S5", "place", ("identity", "level", "position"),
        "6 squares of 25 m over at least 300 m; less evidence if the places are 500 m apart",
        "the levels fit two places {apart_m} m apart better than one (log evidence {log_evidence})",
        "hills and tall buildings, a cell with two antennas",
        0.8, (0, 0, "not measured"),
    ),
    _rule(
        "S9", "place", ("identity", "level", "position"),
        "as S5, with less evidence: a second family must confirm it",
        "the levels fit two places {apart_m} m apart better than one (log evidence {log_evidence})",
        "hills and tall buildings, a cell with two antennas",
        0.8, (0, 0, "not measured"),
    ),
    _rule(
        "S6", "place", ("identity", "level", "position"),
        "6 squares of 25 m over at least 300 m",
        "the levels fit no fixed place (log evidence {log_evidence}): it moves",
        "hills and tall buildings, power that changes with the load",
        0.7, (0, 0, "not measured"),
    ),
    _rule(
        "S7", "place", ("identity", "level", "position"),
        "means over 15 s, at least 4, the walker within 30 m; another cell stays within 10 dB",
        "the level changed by {change_db} dB while the walker stood for {still_s} s and {cells} "
        "other cells changed by at most {other_db} dB: it moves",
        "a telephone that was moved in the house, a door, a vehicle before the antenna",
        0.7, (0, 0, "not measured"),
    ),
    _rule(
        "S10", "place", ("identity", "level", "position", "cell database"),
        "a test of the whole walk rejects the position at a level of 1 %",
        "the levels reject its position in the database by {apart_m} m (p = {p})",
        "a wrong or old position in the database, hills and tall buildings",
        0.25, (3, 161, "161 measured walks past surveyed cells"),
    ),
    _rule(
        "T1", "timing", ("identity", "timing advance", "position"),
        "5 rings at places 50 m apart, more than 20 % of the pairs disjoint",
        "{share:.0%} of its distances by timing advance exclude each other",
        "a modem that repeats an old value",
        0.5, (4, 251, "walks with 251 cells"), rats=frozenset({"GSM", "LTE"}),
    ),
    _rule(
        "C1", "broadcast", ("identity", "C1 and C2"),
        "20 dB above every other of at least 3 cells of the operator",
        "its reselection offset is {offset_db} dB, that of the operator's others {usual_db} dB",
        "an indoor cell or a hot spot of the operator",
        0.6, (0, 194, _FULL_SCANS), rats=_GSM,
    ),
    _rule(
        "C2", "broadcast", ("identity", "level"),
        "3 readings before of at least -85 dBm, 3 after, all within 40 s and of one network",
        "the modem left {left_dbm} dBm for this cell with {level_dbm} dBm",
        "a call that was handed over, another band of the operator",
        0.6, (0, 0, "not measured"),
    ),
    _rule(
        "R1", "technology", ("second technology", "level"),
        "4G or 3G of the same network of at least -105 dBm in the 30 s before, 2G held for 30 s",
        "{before} was left at {level_dbm} dBm, and 2G was kept for {held_s} s",
        "a call, where the operator has no voice over 4G",
        0.6, (2, 1500, "60 h of telephones, about 1500 cells"), rats=_GSM,
    ),
    _rule(
        "B1", "earlier walks", ("identity", "level", "position", "earlier walks"),
        "7 earlier walks with this technology here, the cell at least -95 dBm",
        "{walks} earlier walks did not hear this cell here, today it has {level_dbm} dBm",
        "a new cell, a cell that was repaired",
        0.9, (2, 77, "seven walks after seven others on one route"),
    ),
    _rule(
        "B3", "earlier walks", ("identity", "level", "position", "neighbours", "earlier walks"),
        "heard by 90 % of 7 earlier walks in this square, 15 dB above what scans of 4 cells or "
        "more at 3 places 50 m apart could have missed; only warns",
        "{walks} of {of} earlier walks heard it here with {level_dbm} dBm; today scans at {places} "
        "places, down to {limit_dbm} dBm, do not name it",
        "a cell switched off or repaired, a modem that lists other bands or networks",
        0.5, (0, 0, "not measured"), only_warns=True,
    ),
)  # fmt: skip

RULES = {rule.id: rule for rule in _ROWS}


def rate_of(rule: Rule, rat: str) -> Rate:
    """Rate on legitimate logs: of the technology, of all of them, or of other logs.

    A technology with an alarm never gets a lower rate than its own: few cells are no excuse.
    """
    measured = MEASURED.get(rule.id, {})
    own = measured.get(rat)
    if own is not None and (own.cells >= _FEWEST_MEASURED or own.alarms >= _FEWEST_ALARMS):
        return own
    if rule.elsewhere.cells:
        return rule.elsewhere
    alarms = sum(rate.alarms for rate in measured.values())
    cells = sum(rate.cells for rate in measured.values())
    pooled = Rate(alarms, max(cells, 1), "all technologies")
    if own is not None and own.alarms and own.per_cell > pooled.per_cell:
        return own
    return pooled


def rate_text(rule: Rule, nats: float) -> str:
    """How often legitimate cells break a rule, as it entered a finding of `nats`."""
    if rule.only_warns:
        return "Not measured: it only warns."
    share = min(rule.detection / exp(nats), 1.0) if nats > 0.0 else 1.0
    if share >= 0.3:
        return "Rate not measured here."
    return f"Seen with {share:.1%} of legitimate cells or fewer."
