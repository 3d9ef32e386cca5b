"""The sources that a site.toml names: `[[source]]`, and `[modem]` and `[gnss]` as short forms."""

from collections.abc import Mapping
from typing import Any, TypeGuard

MODEM, NMEA, GPSD = "modem", "nmea", "gpsd"
"""Kinds of sources."""
GNSS = "gnss"
"""Name of the receiver in records, and of its short form."""
GNSS_OF_MODEM = "modem"
"""Port of [gnss] where the modem's own receiver gives the fixes."""


def source_tables(site: Mapping[str, Any]) -> list[Any]:
    """The tables of all sources, each with `kind` and `name`; what is no table stays as it is.

    `[modem]` and `[gnss]` come first. Without a name, modems are "modem", "modem2" and a receiver
    is "gnss".
    """
    modem, gnss, more = site.get("modem"), site.get("gnss"), site.get("source")
    tables = [] if modem is None else [_short(modem, MODEM)]
    if is_of_modem(gnss):
        tables = [one | {"fixes": True} if isinstance(one, dict) else one for one in tables]
    elif gnss is not None:
        tables.append(_receiver(gnss))
    tables += more if isinstance(more, list) else []
    taken = {one.get("name") for one in tables if isinstance(one, dict)}
    return [_with_name(one, taken) for one in tables]


def is_of_modem(gnss: Any) -> TypeGuard[dict[str, Any]]:
    """Whether `[gnss]` names the modem's own receiver."""
    return isinstance(gnss, dict) and gnss.get("port") == GNSS_OF_MODEM


def _short(table: Any, kind: str) -> Any:
    return table | {"kind": kind} if isinstance(table, dict) else table


def _receiver(table: Any) -> Any:
    """A gpsd has no baud rate."""
    if isinstance(table, dict) and str(table.get("port")).startswith("gpsd:"):
        return _short({key: value for key, value in table.items() if key != "baud"}, GPSD)
    return _short(table, NMEA)


def _with_name(table: Any, taken: set[Any]) -> Any:
    if not isinstance(table, dict) or "name" in table:
        return table
    kind = str(table.get("kind"))
    first = GNSS if kind in {NMEA, GPSD} else kind
    name, number = first, 1
    while name in taken:
        number += 1
        name = f"{first}{number}"
    taken.add(name)
    return table | {"name": name}
