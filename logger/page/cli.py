"""`fieldlogger page` and `fieldlogger status`: the running service on a phone and in a terminal."""

import os
import sys
import time
from pathlib import Path

import click

from logger.command_line import PATH, SITE_TOML, json_option, late_modules, show

with late_modules():
    from logger import config as site_file
    from logger.device import status as service_status
    from logger.device import status_text
    from logger.page import server, token

_CLEAR = b"\x1b[H\x1b[2J"


@click.command
@click.option("--watch", is_flag=True, help="Print again each second, until Ctrl-C.")
@json_option
def status(*, watch: bool, as_json: bool) -> int:
    """Show what the running service reports: state, way to go, cells.

    The exit code is 1 while the walk is not being recorded.
    """
    while True:
        said, is_recorded = status_text.report(
            service_status.status_folder() or service_status.FOLDER
        )
        if watch and sys.stdout.isatty():
            sys.stdout.flush()
            os.write(1, _CLEAR)  # past the filter of control characters, which is for others' text
        show(said, as_json=as_json)
        if not watch:
            return int(not is_recorded)
        time.sleep(1.0)


@click.command
@click.option("--config", type=PATH, default=SITE_TOML, show_default=True, metavar="SITE.TOML")
@click.option("--show", "is_shown", is_flag=True, help="Print the page's address and its QR code.")
def page(config: Path, *, is_shown: bool) -> int:
    """Serve the page for a phone in the Pi's own Wi-Fi.

    It is off until [page] listen is set in site.toml.
    """
    site, _ = site_file.load_config(config)
    if is_shown:
        address = token.page_url(site.page.listen, token.state_folder())
        print(f"{address}\n\n{token.qr_code(address)}")
        return 0
    if not site.page.listen:
        print('the page is off; [page] listen = "10.42.0.1:8080" in site.toml turns it on')
        return 0
    return server.serve(site)
