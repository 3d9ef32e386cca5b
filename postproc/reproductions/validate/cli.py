"""The command `validate` of `postproc`."""

import click

from logger.command_line import json_option, late_modules, show
from postproc.options import only_one

with late_modules():
    from postproc import progress
    from postproc.reproductions.validate import report, suite


@click.command
@click.option("--quick", is_flag=True, help="Simulate fewer runs: a few seconds.")
@json_option
@click.option(
    "--page", "as_page", is_flag=True, help="Print VALIDATION.md, without what differs by machine."
)
def validate(*, quick: bool, as_json: bool, as_page: bool) -> int:
    """Check each claim of the specification by measurement."""
    only_one({"--json": as_json, "--page": as_page})
    effort = suite.QUICK if quick else suite.THOROUGH
    groups = progress.with_progress(suite.GROUPS, "checking the specification", len(suite.GROUPS))
    checks = [check for group in groups for check in group(effort)]
    if as_page:
        print(report.page(checks), end="")
    else:
        show(report.document_of(checks), as_json=as_json)
    return 0 if all(check.verdict != "fails" for check in checks) else 1
