"""Worker processes over TCP with TLS: workers are killed, and the scheduler is restarted."""

import json
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import dask.config
import pytest
from distributed import Security

from postproc.result import Options
from postproc.survey.location import EVERY_RUN, locate_survey
from postproc.survey.scheduling import Cluster
from postproc.survey.tasks import locate_cells, tasks_of
from tests.postproc.survey.cities import write_city

ROOT = Path(__file__).parents[3]

pytestmark = pytest.mark.slow


@pytest.fixture
def tls(tmp_path):
    """Options of the processes; the client takes its own from Dask's configuration."""
    keys = Security.temporary()
    files = {}
    for name in ("tls_ca_file", "tls_client_cert", "tls_client_key"):
        files[name] = tmp_path / f"{name}.pem"
        files[name].write_text(getattr(keys, name))
    ca, cert, key = map(str, files.values())
    own = {"ca-file": ca, "client.cert": cert, "client.key": key}
    with dask.config.set({f"distributed.comm.tls.{name}": value for name, value in own.items()}):
        yield ["--tls-ca-file", ca, "--tls-cert", cert, "--tls-key", key]


@pytest.fixture
def start():
    """Start processes, which end with the test."""
    processes = []

    def run(module, *arguments):
        command = [sys.executable, "-m", f"distributed.cli.{module}", *map(str, arguments)]
        quiet = subprocess.DEVNULL
        processes.append(subprocess.Popen(command, cwd=ROOT, stdout=quiet, stderr=quiet))
        return processes[-1]

    yield run
    for process in processes:
        process.kill()
        process.wait()


@pytest.fixture
def cluster_of(tls, start):
    """Starts a scheduler, and workers of it, as often as is asked."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address = f"tls://127.0.0.1:{port}"
    quiet = ("--no-dashboard", *tls)

    def scheduler():
        return start("dask_scheduler", "--host", "127.0.0.1", "--port", port, "--protocol", "tls",
                     *quiet)  # fmt: skip

    def worker():
        return start("dask_worker", address, "--nthreads", 1, "--no-nanny", *quiet)

    return address, scheduler, worker


def test_tls_with_a_killed_worker_and_a_restarted_scheduler(tmp_path, cluster_of):
    address, scheduler, worker = cluster_of
    _, survey = write_city(tmp_path / "s", n_stations=12, n_runs=12)
    tasks = tasks_of(survey, survey.cells(), EVERY_RUN, Options())
    expected = [locate_cells(task) for task in tasks]
    first, workers = scheduler(), [worker(), worker()]
    arrived = []

    def disturb():
        while not arrived:
            time.sleep(0.05)
        workers[0].send_signal(signal.SIGKILL)
        first.send_signal(signal.SIGKILL)
        first.wait()
        scheduler()
        worker()

    disturbance = threading.Thread(target=disturb)
    disturbance.start()
    with Cluster(address) as cluster:
        for task, result in cluster.results(locate_cells, tasks):
            arrived.append((tasks.index(task), result))
            time.sleep(0.5)
    disturbance.join()
    assert [result for _, result in sorted(arrived, key=lambda one: one[0])] == expected


def test_workers_killed_again_and_again(tmp_path, cluster_of, monkeypatch):
    """A worker dies after each second cell, the scheduler once: each cell is there, and once."""
    monkeypatch.setattr("postproc.survey.tasks._MOST_CELLS", 1)
    address, scheduler, worker = cluster_of
    _, survey = write_city(tmp_path / "s", n_stations=12, n_runs=12)
    expected = [locate_cells(task)[0] for task in tasks_of(survey, survey.cells(), EVERY_RUN,
                                                           Options())]  # fmt: skip
    kept = survey.folder / "estimates.jsonl"
    first, workers, n_killed = scheduler(), [worker(), worker()], 0
    is_over = threading.Event()

    def disturb():
        nonlocal n_killed
        while not is_over.wait(0.05):
            n_kept = len(kept.read_bytes().split(b"\n\n")) if kept.exists() else 0
            if n_kept <= 2 * n_killed:
                continue
            workers.pop(0).send_signal(signal.SIGKILL)
            n_killed += 1
            workers.append(worker())
            if n_killed == 2:
                first.send_signal(signal.SIGKILL)
                first.wait()
                scheduler()

    disturbance = threading.Thread(target=disturb)
    disturbance.start()
    try:
        with Cluster(address) as cluster:
            location = locate_survey(survey, Options(), cluster=cluster)
    finally:
        is_over.set()
        disturbance.join()
    assert n_killed >= 4
    assert list(location.cells) == sorted(expected, key=lambda one: (one.area, one.cell))
    lines = [
        json.loads(line)["value"][0]["cell"] for line in kept.read_bytes().splitlines() if line
    ]
    assert sorted(lines) == [one.cell for one in survey.cells()]
