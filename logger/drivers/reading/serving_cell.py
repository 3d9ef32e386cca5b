"""The serving cell of one poll, from the rows of several replies: each contains a part."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import fields, replace
from typing import Any, TypeGuard

from logger.core.types import CellReading, Rat
from logger.drivers.reading.row_language import Operator, Registration, Row, Signal, confirm

_LEVELS = frozenset(
    {"rxlev_raw", "rxq", "rssi_dbm", "rscp_dbm", "ecio_db", "rsrp_dbm", "rsrq_db", "sinr_db"}
)
_AREA_AND_CELL = ("lac", "tac", "cid")


def is_serving(row: Row) -> TypeGuard[CellReading]:
    """True for a reading of the serving cell."""
    return isinstance(row, CellReading) and row.role == "serving"


def chosen_networks(rows: Iterable[Row]) -> Iterator[Operator]:
    """The networks that AT+COPS? names by their code, without those that a scan offers."""
    for row in rows:
        if isinstance(row, Operator) and row.stat is None and row.plmn:
            yield row


def with_serving_cell(rows: Sequence[Row]) -> tuple[Row, ...]:
    """The rows behind the serving cell that +CREG, +COPS and a level describe, where they do."""
    registered = [row for row in rows if isinstance(row, Registration) and row.cid is not None]
    return (*(_registered_cell(row, rows) for row in registered[:1]), *rows)


def _registered_cell(registration: Registration, rows: Sequence[Row]) -> CellReading:
    plmn = next((network.plmn for network in chosen_networks(rows)), None) or ""
    signals = [row for row in rows if isinstance(row, Signal)]
    of_rat = (row for row in signals if row.rat is not None and row.rat == registration.rat)
    signal = next(of_rat, Signal())
    return CellReading(
        role="serving",
        rat=registration.rat,
        mcc=plmn[:3] or None,
        mnc=plmn[3:] or None,
        lac=registration.lac,
        tac=registration.tac,
        cid=registration.cid,
        rssi_dbm=next((row.rssi_dbm for row in signals if row.rssi_dbm is not None), None),
        rscp_dbm=signal.rscp_dbm,
        rsrp_dbm=signal.rsrp_dbm,
        rsrq_db=signal.rsrq_db,
    )


def merge_serving_cells(rows: Iterable[Row]) -> tuple[Row, ...]:
    """Rows of one poll with each serving cell once, first.

    What the first row of a cell leaves open is filled from the others. A level beside another one
    is not taken over: they may be of different scales.
    """
    serving: dict[tuple[Rat | None, int], CellReading] = {}
    others: list[Row] = []
    for row in rows:
        if not is_serving(row) or row.cid is None:
            others.append(row)
            continue
        first = serving.get((row.rat, row.cid))
        serving[row.rat, row.cid] = row if first is None else _merge(first, row)
    return (*serving.values(), *others)


def _merge(first: CellReading, second: CellReading) -> CellReading:
    names = {field.name for field in fields(CellReading)} - {"more"}
    missing = {name for name in names if getattr(first, name) is None}
    filled = missing - _LEVELS if first.level_dbm is not None else missing
    values: dict[str, Any] = {name: getattr(second, name) for name in filled}
    for name in _AREA_AND_CELL:
        number = getattr(first, name)
        if number is not None and number == getattr(second, name):
            values[name] = confirm(number)
    # one area is printed in hexadecimal, the other in decimal
    values["identity_unsure"] = any(
        getattr(second, name) not in {None, getattr(first, name)}
        for name in ("mcc", "mnc", "lac", "tac")
        if name not in missing
    )
    return replace(first, more={**second.more, **first.more}, **values)
