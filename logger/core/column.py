"""How a field of a record is stored in the run file: type, mark of an unknown value, unit.

`types` annotates the fields of each record with these, in this order; `schema` makes the tables of
them.
"""

from dataclasses import dataclass
from typing import Annotated

UNKNOWN_ID = -1
"""Mark of an unknown integer that cannot be negative."""
UNKNOWN_TIME = -(2**63)
UNKNOWN_SIGNED = -(2**31)

Flag = Annotated[bool, "|u1"]
Int = Annotated[int, "<i4"]
Seq = Annotated[int, "<i8"]
Float = Annotated[float, "<f8"]
Real = Annotated[float | None, "<f8"]
Count = Annotated[int | None, "<i4", UNKNOWN_ID]
LongId = Annotated[int | None, "<i8", UNKNOWN_ID]
Signed = Annotated[int | None, "<i4", UNKNOWN_SIGNED]
Time = Annotated[int | None, "<i8", UNKNOWN_TIME]
Digits = Annotated[str | None, "S4"]
Covariance = Annotated[Float, "covariance"]


@dataclass(frozen=True, slots=True)
class Column:
    """One column: numpy dtype, unit or meaning, and the mark of an unknown integer."""

    name: str
    dtype: str
    unit: str
    unknown: int | None = None


def columns_of(record: type) -> tuple[Column, ...]:
    """Columns of the annotated fields of a record, in their order."""
    columns = []
    for name, hint in record.__annotations__.items():
        if stored := getattr(hint, "__metadata__", None):
            dtype, *unknown, unit = stored
            columns.append(Column(name, dtype, unit, *unknown))
    return tuple(columns)
