"""What several tests of surveys share."""

import pytest
from distributed import LocalCluster


@pytest.fixture(scope="module")
def scheduler():
    """A Dask scheduler and a worker within this process."""
    with LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None,
        scheduler_kwargs={"dashboard_address": "127.0.0.1:0"},
    ) as cluster:  # fmt: skip
        yield cluster.scheduler_address
