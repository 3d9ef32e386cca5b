"""The cluster of this machine, beside other programs and other users."""

import http.client
import socket
from contextlib import suppress

import psutil

from postproc.survey.scheduling import Cluster
from tests.kit.interrupted import stderr_of_interrupted


def _ports():
    """Ports at which this process and its children listen."""
    processes = [psutil.Process(), *psutil.Process().children(recursive=True)]
    connections = [one for process in processes for one in process.net_connections("tcp")]
    return {one.laddr.port for one in connections if one.status == psutil.CONN_LISTEN}


def _answer(port, path):
    """HTTP status, None where nobody speaks HTTP."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=5)
    try:
        connection.request("GET", path)
        return connection.getresponse().status
    except (OSError, http.client.HTTPException):
        return None
    finally:
        connection.close()


def test_needs_no_port_of_its_own_and_tells_nobody_what_it_does():
    with socket.socket() as other:
        with suppress(OSError):  # a Dask of another program has it
            other.bind(("127.0.0.1", 8787))
            other.listen()
        before = _ports()
        with Cluster(workers=1) as cluster:
            assert sorted(size for _, size in cluster.results(len, [(), (1,)])) == [0, 1]
            ports = _ports() - before
            assert ports
            paths = ("/", "/health", "/metrics", "/info/main/workers.html", "/json/counts.json")
            assert {_answer(port, path) for port in ports for path in paths} <= {None, 404}


_WORKS_LONG = """
import sys, time
from pathlib import Path
from postproc.survey.scheduling import Cluster

def work(path):
    Path(path).touch()
    time.sleep(0.2)

if __name__ == "__main__":
    with Cluster(None, 1) as cluster:
        list(cluster.results(work, [sys.argv[1]] * 300))
"""


def test_an_interrupt_leaves_no_traceback_of_a_worker(tmp_path):
    """A terminal sends Ctrl-C to all processes: the workers leave it to the command."""
    said, waited_s = stderr_of_interrupted(_WORKS_LONG, tmp_path)
    assert waited_s < 20.0
    assert said.count("Traceback") == 1, said  # that of this program, which leaves it to Python
    assert "KeyboardInterrupt" in said
