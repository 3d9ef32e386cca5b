"""Errors, named by what the caller can do about them.

FieldLoggerError
+-- ConfigError       edit the file or the command line
+-- DeviceError       wait and try again
+-- RunFileError      this file cannot be read or written
+-- GeoError          the position cannot be mapped
+-- EstimationError   the data do not hold the answer
"""

from os import strerror
from pathlib import Path

SOMETHING_LOST = 3
"""Exit code where a part of the work failed and the rest was done; 2 is a wrong command."""


class FieldLoggerError(Exception):
    """Root of all errors that a user sees as one line."""


class ConfigError(FieldLoggerError):
    """The configuration or the command line is wrong."""


class DeviceError(FieldLoggerError):
    """A port cannot be opened or has disappeared."""


class RunFileError(FieldLoggerError):
    """A file is not a run, or cannot be written."""


class GeoError(FieldLoggerError):
    """A position cannot be put on the map."""


class EstimationError(FieldLoggerError):
    """The measurements do not determine the result."""


_MOST_CHARACTERS = 200
"""Of an error's text, which may quote data of any length."""


def error_place(error: Exception) -> str:
    """Type and place of an unexpected error; its text may quote what is private."""
    return f"{type(error).__name__}{_place_of(error)}"


def error_text(error: Exception) -> str:
    """Type, text and place of an unexpected error, in one line."""
    text = " ".join(str(error).split())[:_MOST_CHARACTERS]
    return f"{type(error).__name__}{f': {text}' * bool(text)}{_place_of(error)}"


def why_not_written(error: OSError | RuntimeError) -> str:
    """As the system says."""
    number = getattr(error, "errno", None)  # HDF5 has a text of its own
    return strerror(number) if number else str(error)


def _place_of(error: Exception) -> str:
    place, step = "", error.__traceback__
    while step is not None:
        if str(step.tb_frame.f_globals.get("__name__")).startswith(("logger.", "postproc.")):
            place = f" ({Path(step.tb_frame.f_code.co_filename).name}:{step.tb_lineno})"
        step = step.tb_next
    return place
