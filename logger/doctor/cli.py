"""The commands `check` and `doctor` of `fieldlogger`."""

import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import click

from logger.command_line import (
    DURATION_S,
    FILE,
    PATH,
    SITE_TOML,
    json_option,
    late_modules,
    show,
)

with late_modules():
    from logger import check as checking
    from logger.doctor import examination


@click.command
@click.option("--config", type=PATH, metavar="SITE.TOML")
@json_option
def check(config: Path | None, *, as_json: bool) -> int:
    """Check configuration and installation without opening a port."""
    lines = checking.check(config)
    show(checking.document_of(lines), as_json=as_json)
    return checking.exit_code(lines)


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

    def progress(what: str) -> None:
        if sys.stderr.isatty():
            print(f"\r\033[K{what}", end="", file=sys.stderr, flush=True)

    with _errors_only():  # the lines replace the service's log
        examined = examination.examine(config, trial_s, progress)
    progress("")
    if report is not None:
        examination.write_report(report, examined.lines, config, examined.run)
    show(checking.document_of(examined.lines), as_json=as_json)
    return checking.exit_code(examined.lines)


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
