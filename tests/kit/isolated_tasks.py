"""Ways in which reading a damaged file ends, as tasks of a process of its own."""

import ctypes
import os
import signal
import threading

import numpy as np

from logger.core.errors import RunFileError

ROWS = np.array([(1, b"a", 0.5), (2, b"b", np.nan)], [("n", "<i8"), ("text", "S3"), ("x", "<f8")])
ARRAYS = {"rows": ROWS, "none": ROWS[:0], "bytes": np.arange(3_000_000, dtype="u1")}

LOCK = threading.Lock()


def succeed(_path, value):
    return value, ARRAYS


def crash(_path):
    ctypes.string_at(0)


def abort(_path):
    os.abort()


def leave(_path):
    os._exit(0)


def fill_bytes(_path):
    return bytearray(8 << 30)


def fill_array(_path):
    return np.zeros(8 << 30, "u1").sum()


def refuse(_path):
    raise RunFileError("message of the task")


def no_row(_path):
    raise ValueError("no row")


def too_deep(_path):
    raise RecursionError("too deep")


def chatter(_path):
    print("something of a library")
    os.write(1, b"and of its lower half")
    return None, {}


def under_lock(_path):
    with LOCK:
        return None, {}


def compute(_path):
    while True:
        pass


def wait(_path):
    signal.pause()


def process(_path):
    return os.getpid(), {}


def length(path):
    return path.stat().st_size, {}
