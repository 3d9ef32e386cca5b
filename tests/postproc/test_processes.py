import os
from concurrent.futures import ProcessPoolExecutor

import pytest

from postproc import processes
from postproc.processes import each


def process_of(_):
    return os.getpid()


def with_process(item):
    return item, os.getpid()


def fails_elsewhere(parent):
    if os.getpid() != parent:
        os._exit(1)
    return parent


@pytest.fixture
def no_pool(monkeypatch):
    class Refused(ProcessPoolExecutor):
        def __init__(self, *_):
            raise OSError("no semaphores here")

    monkeypatch.setattr(processes, "ProcessPoolExecutor", Refused)


def test_results_come_in_order_from_other_processes():
    found = list(each(with_process, [3, 1, 2, 0], 2))
    assert [item for item, _ in found] == [3, 1, 2, 0]
    assert os.getpid() not in {process for _, process in found}


@pytest.mark.parametrize(("count", "most"), [(4, 1), (3, 8), (1, 2), (0, 2)])
def test_little_work_stays_here(count, most):
    assert set(each(process_of, range(count), most)) <= {os.getpid()}


def test_without_processes_the_work_is_done_here(no_pool):
    assert list(each(process_of, range(4), 2)) == [os.getpid()] * 4


def test_a_process_that_is_killed_leaves_its_work_here():
    assert list(each(fails_elsewhere, [os.getpid()] * 4, 2)) == [os.getpid()] * 4
