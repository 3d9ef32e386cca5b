"""The report of a small run, and its page."""

import pytest

from postproc.report.rendering import make_report
from tests.kit import sample_results as kit
from tests.kit.html_page import Page


@pytest.fixture(scope="session")
def result(tmp_path_factory):
    run = kit.write_run(tmp_path_factory.mktemp("report") / "walk.journal", seconds=120, cells=3)
    return kit.sample_result(run)


@pytest.fixture(scope="session")
def report(result):
    return make_report(result, kit.sample_claims(result))


@pytest.fixture(scope="session")
def page(report):
    return Page(report.html)
