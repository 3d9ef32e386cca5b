"""`fieldlogger page` and `fieldlogger status`: the running service on a phone and in a terminal."""

import os
import shutil
import sys
import time
from pathlib import Path

import click

from logger.command_line import PATH, SITE_TOML, json_option

_CLEAR = b"\x1b[H\x1b[2J"
MOST_COLUMNS = 100
"""Longer lines are hard to read."""


@click.command
@click.option("--watch", is_flag=True, help="Print again each second, until Ctrl-C.")
@json_option
def status(*, watch: bool, as_json: bool) -> int:
    """Show what the running service reports: state, way to go, cells.

    The exit code is 1 while the walk is not being recorded.
    """
    from logger.device.status import FOLDER, status_folder
    from logger.device.status_text import report

    while True:
        columns = min(shutil.get_terminal_size().columns, MOST_COLUMNS)
        found = report(status_folder() or FOLDER, as_json=as_json, columns=columns)
        if watch and sys.stdout.isatty():
            sys.stdout.flush()
            os.write(1, _CLEAR)  # past the filter of control characters, which is for others' text
        print(found.text, flush=True)
        if not watch:
            return int(not found.is_recorded)
        time.sleep(1.0)


@click.command
@click.option("--config", type=PATH, default=SITE_TOML, show_default=True, metavar="SITE.TOML")
@click.option("--show", is_flag=True, help="Print the page's address and its QR code.")
def page(config: Path, *, show: bool) -> int:
    """Serve the page for a phone in the Pi's own Wi-Fi.

    It is off until [page] listen is set in site.toml.
    """
    from logger.config import load_config

    site, _ = load_config(config)
    if show:
        from logger.page.token import page_url, qr_code, state_folder

        address = page_url(site.page.listen, state_folder())
        print(f"{address}\n\n{qr_code(address)}")
        return 0
    if not site.page.listen:
        print('the page is off; [page] listen = "10.42.0.1:8080" in site.toml turns it on')
        return 0
    from logger.page.server import serve

    return serve(site)
