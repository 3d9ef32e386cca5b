"""Errors, named by what the caller can do about them.

FieldLoggerError
+-- ConfigError       edit the file or the command line
+-- DeviceError       wait and try again
+-- RunFileError      this file cannot be read or written
+-- GeoError          the position cannot be mapped
+-- EstimationError   the data do not hold the answer
"""


class FieldLoggerError(Exception):
    """Root of everything that is shown to a user as one line."""


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


def place_of(error: Exception) -> str:
    """Type and place of an exception in this program: its message may have what is private."""
    place, step = "", error.__traceback__
    while step is not None:
        module = step.tb_frame.f_globals.get("__name__", "")
        if module.startswith("logger.") or not place:
            place = f"{module}:{step.tb_lineno}"
        step = step.tb_next
    return f"{type(error).__name__} in {place}"
