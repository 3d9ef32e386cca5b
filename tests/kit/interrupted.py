"""A program that gets Ctrl-C with all its processes, as from a terminal."""

import os
import signal
import subprocess
import sys
import time


def stderr_of_interrupted(program, folder):
    """What a program says, and how long it goes on, in s.

    It gets the interrupt once it has made the file that it is given.
    """
    file, begun = folder / "program.py", folder / "begun"
    file.write_text(program)
    command = [sys.executable, str(file), str(begun)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, process_group=0) as process:
        while not begun.exists() and process.poll() is None:
            time.sleep(0.01)
        interrupted_s = time.monotonic()
        os.killpg(process.pid, signal.SIGINT)
        _, said = process.communicate(timeout=60.0)
        return said, time.monotonic() - interrupted_s
