"""The command `validate` of `postproc`."""

import argparse


def add_validate(validate: argparse.ArgumentParser) -> None:
    validate.add_argument(
        "--quick", action="store_true", help="fewer simulated runs: a few seconds"
    )
    form = validate.add_mutually_exclusive_group()
    form.add_argument("--json", action="store_true")
    form.add_argument(
        "--page", action="store_true", help="print VALIDATION.md, without what differs by machine"
    )
    validate.set_defaults(command=_validate)


def _validate(arguments: argparse.Namespace) -> int:
    from postproc.progress import shown
    from postproc.reproductions.validate import report
    from postproc.reproductions.validate.suite import GROUPS, QUICK, THOROUGH

    effort = QUICK if arguments.quick else THOROUGH
    groups = shown(GROUPS, "checking the specification", len(GROUPS))
    found = [check for group in groups for check in group(effort)]
    if arguments.json:
        print(report.as_json(found))
    elif arguments.page:
        print(report.page(found), end="")
    else:
        report.print_checks(found)
    return 0 if all(check.verdict != "fails" for check in found) else 1
