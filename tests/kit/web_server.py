"""The web server of `postproc view --web`, in a process of its own."""

import subprocess
import sys
from http.client import HTTPConnection
from pathlib import Path

_PROGRAM = """
import shutil, sys
from postproc.view.viewer import serve

def copy(path):
    shutil.copy(sys.argv[1], path)

sys.exit(serve(copy, 0, lambda address: print(address, flush=True)))
"""


class WebServer:
    """A running server and its responses."""

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
        response = connection.getresponse()
        result = response.status, dict(response.getheaders()), response.read()
        connection.close()
        return result

    def stop(self, number) -> int:
        """Send a signal and return the exit code; the output on stderr is then in `errors`."""
        self.process.send_signal(number)
        _, self.errors = self.process.communicate(timeout=60)
        return self.process.returncode
