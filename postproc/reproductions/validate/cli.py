"""The command `validate` of `postproc`."""

import click

from logger.command_line import json_option
from postproc.options import only_one


@click.command
@click.option("--quick", is_flag=True, help="Simulate fewer runs: a few seconds.")
@json_option
@click.option(
    "--page", "as_page", is_flag=True, help="Print Markdown, without what differs by machine."
)
def validate(*, quick: bool, as_json: bool, as_page: bool) -> int:
    """Check each claim of the specification by measurement."""
    from postproc.progress import with_progress
    from postproc.reproductions.validate import report
    from postproc.reproductions.validate.suite import GROUPS, QUICK, THOROUGH

    only_one({"--json": as_json, "--page": as_page})
    effort = QUICK if quick else THOROUGH
    groups = with_progress(GROUPS, "checking the specification", len(GROUPS))
    checks = [check for group in groups for check in group(effort)]
    if as_json:
        print(report.as_json(checks))
    elif as_page:
        print(report.page(checks), end="")
    else:
        report.print_checks(checks)
    return 0 if all(check.verdict != "fails" for check in checks) else 1
