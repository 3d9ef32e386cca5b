"""A recording served to browsers by a process of its own, as the command does it."""

import subprocess
import sys
from http.client import HTTPConnection
from pathlib import Path

_PROGRAM = """
import shutil, sys
from postproc.view.web import serve
sys.exit(serve(lambda path: shutil.copy(sys.argv[1], path), 0, lambda address: print(address, flush=True)))
"""


class WebServer:
    """A running server, and what it answers."""

    def __init__(self, recording: Path) -> None:
        command = [sys.executable, "-c", _PROGRAM, str(recording)]
        self.process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        self.address = self.process.stdout.readline().strip()
        self.port = int(self.address.rpartition(":")[2].rstrip("/"))

    def get(self, path, host=None, method="GET"):
        """Status, headers and content."""
        connection = HTTPConnection("127.0.0.1", self.port, timeout=60)
        connection.request(method, path, headers={"Host": host or f"127.0.0.1:{self.port}"})
        answer = connection.getresponse()
        found = answer.status, dict(answer.getheaders()), answer.read()
        connection.close()
        return found

    def stop(self, number) -> int:
        """Send a signal; the exit code. What was said on stderr is in `said`."""
        self.process.send_signal(number)
        _, self.said = self.process.communicate(timeout=60)
        return self.process.returncode
