"""Our commands: their help and whether a line of the documentation fits it."""

import contextlib
import io
import re
import shlex
from functools import cache

from logger.cli import main as fieldlogger
from postproc.cli import main as postproc

PROGRAMS = {"fieldlogger": fieldlogger, "postproc": postproc}


def run(program: str, *arguments: str) -> tuple[int, str]:
    """Exit code and output of a command, run in this process."""
    output = io.StringIO()
    with contextlib.redirect_stdout(output), contextlib.redirect_stderr(output):
        try:
            code = PROGRAMS[program](list(arguments))
        except SystemExit as stop:
            code = stop.code
    return int(code or 0), output.getvalue()


@cache
def help_of(program: str, *command: str) -> str:
    """The help of a command; empty where there is no such command."""
    code, text = run(program, *command, "--help")
    return "" if code else text


def fits(line: str) -> bool:
    """True when the command of a line exists and its help names every option of the line."""
    words = shlex.split(line)
    program, arguments = words[0].rpartition("/")[2], words[1:]
    if program not in PROGRAMS:
        return False
    names = [word for word in arguments if re.fullmatch(r"[a-z][a-z-]*", word)]
    command = names[:1] if arguments[:1] == names[:1] else []
    group = help_of(program, *names[:2]) if len(names) > 1 and arguments[:2] == names[:2] else ""
    text = group or help_of(program, *command)
    options = [word.split("=")[0] for word in arguments if re.fullmatch(r"--?[a-z][\w=-]*", word)]
    return bool(text) and all(re.search(rf"(?<![\w-]){option}\b", text) for option in options)
