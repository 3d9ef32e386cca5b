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
