"""A row of a table, of JSON or of a text as a sighting, by what its format calls the values."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from logger.core.types import Rat, Role
from postproc.interop.fields import (
    LEVEL_RANGE_DBM,
    RATS,
    Fields,
    Moment,
    cell_identity,
    fix_of,
    integer,
    maybe,
    network_code,
    number,
    plmn,
    reading_of,
    text,
)
from postproc.interop.sighting import NoCell, Sighting

Names = tuple[str, ...]
"""Names of a column, of which the first that has a value counts."""
ROW_NS = 10**9
"""From row to row where only their order is known."""
CODES: Mapping[Rat, str] = {"GSM": "bsic", "WCDMA": "psc", "LTE": "pci", "NR": "pci"}
"""What a technology calls the code of a cell."""


def in_order(line: int, _: Fields) -> Moment:
    """The number of a row, where a file has no times."""
    return Moment(line * ROW_NS, is_utc=False)


def level_in(name: str) -> Callable[[Fields, Rat | None], float]:
    """The level of a column in dBm; a row without it is a bad one."""
    return lambda fields, _: number(fields, name, LEVEL_RANGE_DBM)


def by_flag(*names: str, means: Role, otherwise: Role) -> Callable[[Fields], Role]:
    """The role by a column of true and false; without a value it is `scan`."""

    def role(fields: Fields) -> Role:
        flag = text(fields, *names).lower()
        if not flag:
            return "scan"
        return means if flag in {"true", "1"} else otherwise

    return role


@dataclass(frozen=True, slots=True, kw_only=True)
class Columns:
    """Columns of a format in lower case.

    `codes` are by technology the columns of the BSIC, PSC or PCI, `more` gives further values of a
    reading by our names. With `half_networks` a country without a network counts as well. Rows
    without a known technology are no cells if `needs_rat`.
    """

    level_dbm: Callable[[Fields, Rat | None], float | None]
    when: Callable[[int, Fields], Moment] = in_order
    role: Callable[[Fields], Role] = lambda _: "scan"
    rat: Names = ("rat",)
    place: tuple[str, str] = ("lat", "lon")
    alt_m: Names = ()
    acc_m: Names = ()
    speed_mps: Names = ()
    course_deg: Names = ()
    area: Mapping[Rat, Names] | Names = ("lac",)
    cid: Names = ("cid",)
    arfcn: Names = ("arfcn",)
    codes: Mapping[Rat, Names] = field(default_factory=dict)
    ta: Mapping[Rat, Names] | Names = ()
    more: Callable[[Fields, Rat | None], Mapping[str, Any]] = lambda *_: {}
    half_networks: bool = False
    needs_rat: bool = True

    def sighting(self, line: int, fields: Fields) -> Sighting | NoCell:
        """The row; raises ValueError or `GeoError` for a bad one."""
        name = text(fields, *self.rat)
        rat = RATS.get(name.upper())
        if rat is None and self.needs_rat:
            return NoCell(line, f"no technology of 2G to 5G is called {name[:40]!r}")
        moment = self.when(line, fields)
        acc = _name_in(fields, self.acc_m)
        known = {
            "alt_m": maybe(fields, _name_in(fields, self.alt_m)),
            "acc_m": maybe(fields, acc, (0.0, 1e6)) or None,
            "speed_mps": maybe(fields, _name_in(fields, self.speed_mps)),
            "course_deg": maybe(fields, _name_in(fields, self.course_deg)),
        }
        lat, lon = self.place
        fix = fix_of(fields, lat, lon, moment.utc_ns, **known)
        mcc, mnc = plmn(fields)
        if self.half_networks:
            mcc, mnc = network_code(fields, "mcc", 3), network_code(fields, "mnc", 2)
        values: dict[str, Any] = {
            "mcc": mcc,
            "mnc": mnc,
            "cid": cell_identity(fields, *self.cid),
            "arfcn": integer(fields, *self.arfcn),
            "ta": _first_known(fields, _names(self.ta, rat)),
        }
        if rat is not None and rat in self.codes:
            values[CODES[rat]] = _first_known(fields, self.codes[rat])
        reading = reading_of(
            rat,
            self.role(fields),
            self.level_dbm(fields, rat),
            _first_known(fields, _names(self.area, rat)),
            **values,
            **self.more(fields, rat),
        )
        return Sighting(line, moment.t_ns, fix, reading)


def _names(names: Mapping[Rat, Names] | Names, rat: Rat | None) -> Names:
    if isinstance(names, Mapping):
        return () if rat is None else names.get(rat, ())
    return names


def _name_in(fields: Fields, names: Names) -> str:
    """The first of these columns that the file has, "" for none."""
    return next((name for name in names if name in fields), "")


def _first_known(fields: Fields, names: Names) -> int | None:
    """First known integer: an app writes a mark where another one leaves the column empty."""
    return next((value for name in names if (value := integer(fields, name)) is not None), None)
