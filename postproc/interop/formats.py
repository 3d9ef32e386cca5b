"""The formats that are imported; each is recognised by what is in the file."""

import pkgutil
from collections.abc import Iterator, Mapping
from importlib import import_module
from pathlib import Path

from logger.core.errors import RunFileError
from postproc.interop import readers
from postproc.interop.contents import Contents, Format, look_at, unknown_format
from postproc.interop.fields import RATS
from postproc.interop.readers import named_columns


def formats() -> list[Format]:
    """Those in the `IMPORTS` of the modules in `readers`; the first that fits a file reads it.

    Those with names that nobody else has come first.
    """
    return sorted(_all_formats(), key=lambda form: form.is_general)


def _all_formats() -> Iterator[Format]:
    for module in pkgutil.iter_modules(readers.__path__, f"{readers.__name__}."):
        yield from import_module(module.name).IMPORTS


def recognise(source: Path, columns: Mapping[str, str] | None = None) -> Format:
    """Format of a file by its content, or the one that reads the `columns` named by the user.

    Raises `RunFileError` for a file that is none of them.
    """
    if columns:
        return named_columns.format_of(source, columns)
    seen = look_at(source)
    if _is_cell_list(seen):
        raise RunFileError(
            f"{source} is a list of cells, not a walk; `postproc celldb import` reads those of "
            "OpenCelliD and Mozilla"
        )
    form = next((form for form in formats() if form.is_it(seen)), None)
    if form is None:
        raise unknown_format(source, seen.words, seen.kind)
    return named_columns.format_of(source, {}) if form.name == named_columns.NAME else form


def _is_cell_list(seen: Contents) -> bool:
    """Whether a text lists cells: country files of OpenCelliD and NTM files have no header.

    They begin with the technology of a cell. A walk of CellMapper does not.
    """
    first = seen.head.replace(";", ",").partition(",")[0].strip().upper()
    return seen.kind == "text" and (
        seen.has("radio", "net", "area", "cell") or first in {*RATS, "CDMA"}
    )
