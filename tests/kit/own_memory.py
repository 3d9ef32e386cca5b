"""A function in a process of its own, with the memory that it takes beyond the program's.

The processes are forked from one that has imported the function: to start Python anew takes a
second each time, and an executed program begins with the peak of the process that started it
(Linux counts it on), which is that of the tests.
"""

import atexit
import json
import subprocess
import sys
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

MOST_S = 120.0
_PROGRAM = """
import json, os, pkgutil, resource, signal, sys
function = pkgutil.resolve_name(sys.argv[1])
for name in sys.argv[2:]:
    __import__(name)
def peak():
    processes = resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN
    return max(resource.getrusage(one).ru_maxrss for one in processes) >> 10
for job in sys.stdin:
    arguments, environment, folder, most_s = json.loads(job)
    child = os.fork()
    if not child:
        signal.alarm(most_s)
        os.environ.update(environment)
        for number, name in (1, "out"), (2, "err"):
            os.dup2(os.open(f"{folder}/{name}", os.O_CREAT | os.O_WRONLY, 0o600), number)
        before, code = peak(), 1
        try:
            code = function(arguments) or 0
            with open(f"{folder}/more", "w") as file:
                print(peak() - before, file=file)
        except BaseException:
            sys.excepthook(*sys.exc_info())
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""


class Done(NamedTuple):
    """How the function ended; `more_mb` is the peak of its memory less that of the program."""

    code: int
    more_mb: int
    out: str
    err: str


@cache
def _server(function, *imports):
    process = subprocess.Popen(
        [sys.executable, "-c", _PROGRAM, function, *imports],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    atexit.register(process.communicate)  # without another job it ends
    return process


def run_alone(function, *arguments, imports=(), environment=None):
    """Call "module:function" with a list of texts, where `imports` are loaded too.

    What it returns is the exit code. Raises `AssertionError` where it raises or is killed.
    """
    process = _server(function, *imports)
    with TemporaryDirectory() as folder:
        job = [[*map(str, arguments)], environment or {}, folder, round(MOST_S)]
        process.stdin.write(json.dumps(job) + "\n")
        process.stdin.flush()
        code = int(process.stdout.readline())
        out, err = (Path(folder, name).read_text() for name in ("out", "err"))
        more = Path(folder, "more")
        assert more.exists(), f"{code}: {err[-2000:]}"
        return Done(code, int(more.read_text()), out, err)
