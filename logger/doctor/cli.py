"""The commands `check` and `doctor` of `fieldlogger`."""

import logging
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from logger.command_line import DURATION_S, FILE, PATH, SITE_TOML, json_option, print_json

if TYPE_CHECKING:
    from logger.check import Line


@click.command
@click.option("--config", type=PATH, metavar="SITE.TOML")
@json_option
def check(config: Path | None, *, as_json: bool) -> int:
    """Check configuration and installation without opening a port."""
    from logger.check import check

    return _print_lines(check(config), as_json=as_json)


@click.command
@click.option("--config", type=PATH, default=SITE_TOML, show_default=True, metavar="SITE.TOML")
@click.option(
    "--seconds",
    "trial_s",
    type=DURATION_S,
    default=15.0,
    show_default=True,
    metavar="S",
    help="Length of the test recording.",
)
@click.option(
    "--report",
    type=FILE,
    metavar="FILE",
    help="Write all lines, versions and settings, without private numbers.",
)
@json_option
def doctor(config: Path, trial_s: float, report: Path | None, *, as_json: bool) -> int:
    """Test power, card, clock, ports, modem and receiver; the verdict is the first line."""
    from logger.doctor.bundle import write_report
    from logger.doctor.examination import examine

    def progress(what: str) -> None:
        if sys.stderr.isatty():
            print(f"\r\033[K{what}", end="", file=sys.stderr, flush=True)

    with _errors_only():  # the lines replace the service's log
        examination = examine(config, trial_s, progress)
    progress("")
    if report is not None:
        write_report(report, examination.lines, config, examination.run)
    return _print_lines(examination.lines, as_json=as_json)


@contextmanager
def _errors_only() -> Iterator[None]:
    """Log nothing below an error; afterwards as before, for a caller that goes on."""
    log = logging.getLogger()
    level = log.level
    log.setLevel(logging.ERROR)
    try:
        yield
    finally:
        log.setLevel(level)


def _print_lines(lines: "Iterable[Line]", *, as_json: bool) -> int:
    """Print each line as soon as its check is done; the exit code is 2 if one failed."""
    printed = []
    for line in lines:
        printed.append(line)
        if not as_json:
            print(f"{line.state:4}  {line.what}: {line.text}", flush=True)
    if as_json:
        print_json([asdict(line) for line in printed])
    return 2 if any(line.state == "fail" for line in printed) else 0
