"""The command `fieldlogger`: what a user runs on the Pi."""

import logging
import os
import re
import sys
import textwrap
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from typing import Any

import click

from logger.command_line import (
    DURATION_S,
    FILE,
    INPUT,
    PATH,
    SEED,
    SITE_TOML,
    Program,
    json_option,
    late_modules,
    number,
    recover,
    run_program,
    show,
    version_option,
)
from logger.core.errors import ConfigError

with late_modules():
    from logger import check as checking
    from logger import config as site_file
    from logger import own_baseline
    from logger import probe as probing
    from logger import simulate as simulation
    from logger.core import cell_names, document, live_settings
    from logger.device import battery, clock, memory, notify, service, startup
    from logger.device import status as service_status
    from logger.doctor import examination
    from logger.drivers import registry, transcript
    from logger.drivers.reading import row_language as reading_rows
    from logger.page import server, token

FASTEST = 10_000
"""More than any machine simulates."""

_CLEAR = b"\x1b[H\x1b[2J"
_COLUMNS = 50
"""Columns of help with names; click would break a line at a hyphen."""


class NameOption(click.Option):
    """An option whose help lists the names it takes: the keys of `variable` in `module`.

    Only the help imports the module. The list is left out without numpy, as where the manual pages
    are made.
    """

    def __init__(self, *declarations: Any, module: str, variable: str, **attributes: Any) -> None:
        super().__init__(*declarations, **attributes)
        self._module, self._variable = module, variable

    def get_help_record(self, ctx: click.Context) -> tuple[str, str] | None:
        record = super().get_help_record(ctx)
        with suppress(ModuleNotFoundError):
            names = ", ".join(getattr(import_module(self._module), self._variable))
            text = f"{self.help} NAME is one of {names}."
            lines = textwrap.fill(text, _COLUMNS, break_on_hyphens=False)
            return record and (record[0], f"\b\n{lines}")
        return record


def main(argv: list[str] | None = None) -> int:
    """Run a command and return its exit code."""
    # the locator's matrices are small: threads of BLAS would only wait for each other
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    logging.basicConfig(level=logging.INFO, format="%(levelname)s %(message)s", stream=sys.stderr)
    return run_program(program, "fieldlogger", argv)


_SECTIONS = {
    "Prepare": ("probe", "check", "doctor"),
    "Record": ("run", "status", "page"),
    "Files": ("recover", "parse"),
    "Earlier walks": ("learn", "forget", "trust"),
    "Try without hardware": ("simulate",),
}


@click.group(
    cls=Program,
    sections=_SECTIONS,
    no_args_is_help=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
@version_option()
def program() -> None:
    """Record the cells and positions of a walk. The logger only listens."""


program.add_command(recover)

config_option = click.option(
    "--config",
    "config_path",
    type=PATH,
    default=SITE_TOML,
    show_default=True,
    metavar="SITE.TOML",
)


@program.command
@click.option("--config", type=PATH, metavar="SITE.TOML")
@json_option
def check(config: Path | None, *, as_json: bool) -> int:
    """Check configuration and installation without opening a port."""
    lines = checking.check(config)
    show(checking.document_of(lines), as_json=as_json)
    return checking.exit_code(lines)


@program.command
@config_option
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
def doctor(config_path: Path, trial_s: float, report: Path | None, *, as_json: bool) -> int:
    """Test power, card, clock, ports, modem and receiver; the verdict is the first line."""

    def progress(what: str) -> None:
        if sys.stderr.isatty():
            print(f"\r\033[K{what}", end="", file=sys.stderr, flush=True)

    with _errors_only():  # the lines replace the service's log
        examined = examination.examine(config_path, trial_s, progress)
    progress("")
    show(checking.document_of(examined.lines), as_json=as_json)
    if report is not None:
        examination.write_report(report, examined.lines, config_path, examined.run)
    return checking.exit_code(examined.lines)


@contextmanager
def _errors_only() -> Iterator[None]:
    """Log only errors; the level is restored for a caller that goes on."""
    log = logging.getLogger()
    level = log.level
    log.setLevel(logging.ERROR)
    try:
        yield
    finally:
        log.setLevel(level)


@program.command
@click.option("--config", type=PATH, required=True, metavar="SITE.TOML")
@click.option(
    "--duration", "duration_s", type=DURATION_S, metavar="S", help="Stop after S seconds."
)
def run(config: Path, duration_s: float | None) -> None:
    """Record until SIGTERM, SIGINT or a power cut."""
    from msgspec.structs import replace  # noqa: PLC0415 (no help needs it)

    site, text = site_file.load_config(config)
    site = replace(site, live=memory.within_memory(site.live))
    system_clock, manager = clock.Clock(), notify.ServiceManager.of(os.environ)
    if duration_s is None and site.run.longest_h:
        duration_s = 3600.0 * site.run.longest_h  # systemd starts the next run
    with notify.stop_signals() as stop:
        if site.power.stop_percent or site.power.stop_volts:
            battery.wait_for_charger(site.power, manager, stop[0])
            if stop[0].is_set():
                return
        writer = startup.begin_run(site, text, system_clock)  # before service, which is slow
        if writer.is_durable:
            manager.alive()
        learning = [sys.executable, "-m", "logger.cli", "learn", "--config", str(config)]
        path = service.run_service(site, writer, manager, system_clock, stop, duration_s, learning)
        print(path)


@program.command
@click.option("--watch", is_flag=True, help="Print again each second, until Ctrl-C.")
@json_option
def status(*, watch: bool, as_json: bool) -> int:
    """Show what the running service reports: state, way to go, cells.

    The exit code is 1 while the walk is not being recorded.
    """
    while True:
        folder = service_status.status_folder() or service_status.FOLDER
        said, is_recorded = service_status.report(folder)
        if watch and sys.stdout.isatty():
            sys.stdout.flush()
            os.write(1, _CLEAR)  # past the filter of control characters, which is for others' text
        show(said, as_json=as_json)
        if not watch:
            return int(not is_recorded)
        time.sleep(1.0)


@program.command
@config_option
@click.option("--show", "is_shown", is_flag=True, help="Print the page's address and its QR code.")
def page(config_path: Path, *, is_shown: bool) -> int:
    """Serve the page for a phone in the Pi's own Wi-Fi.

    It is off until [page] listen is set in site.toml.
    """
    site, _ = site_file.load_config(config_path)
    if is_shown:
        address = token.page_url(site.page.listen, token.state_folder())
        print(f"{address}\n\n{token.qr_code(address)}")
        return 0
    if not site.page.listen:
        print('the page is off; [page] listen = "10.42.0.1:8080" in site.toml turns it on')
        return 0
    return server.serve(site)


def _own_folder(config_path: Path) -> Path:
    """The folder whose runs teach the device."""
    return startup.usable_folder(site_file.load_config(config_path)[0].run.directory)


@program.command
@config_option
@json_option
def learn(config_path: Path, *, as_json: bool) -> None:
    """Make the device's baseline follow its runs, as the service does by itself."""
    own_baseline.give_way()
    site, _ = site_file.load_config(config_path)
    folder = startup.usable_folder(site.run.directory)
    changes = own_baseline.learn(folder, adds=site.live.baseline == live_settings.OWN)
    content = dict(changes)
    body = [f"{run}: {what}" for run, what in content.items()]
    remarks = () if body else ("nothing new to learn",)
    show(document.Document(content, body=body, remarks=remarks), as_json=as_json)


@program.command
@click.argument("run", metavar="RUN|all")
@config_option
@json_option
def forget(run: str, config_path: Path, *, as_json: bool) -> None:
    """Remove for good what a run has taught the device's baseline."""
    n_runs = own_baseline.forget(_own_folder(config_path), run)
    text = f"{document.number_of(n_runs, 'run')} forgotten"
    show(document.Document({"forgotten": n_runs}, body=[text]), as_json=as_json)


@program.command
@click.argument("cell", metavar="CELL")
@click.argument("note", metavar="NOTE")
@config_option
@json_option
def trust(cell: str, note: str, config_path: Path, *, as_json: bool) -> None:
    """Trust a cell in the device's baseline, with a NOTE that says why."""
    if not cell_names.is_identity(cell):
        raise ConfigError(f"{cell!r} is no cell: mcc-mnc-area-cid is wanted, like 262-01-801-86355")
    own_baseline.trust(_own_folder(config_path), cell, note)
    content = {"cell": cell, "note": note}
    show(document.Document(content, body=[f"{cell} is trusted: {note}"]), as_json=as_json)


@program.command
@click.argument("ports", nargs=-1, metavar="[PORT]...")
@click.option(
    "--write", "target", type=PATH, metavar="SITE.TOML", help="Write the proposal to a new file."
)
@json_option
def probe(ports: tuple[str, ...], target: Path | None, *, as_json: bool) -> None:
    """Find the modem and the receiver and propose a site.toml.

    PORT limits the search to these ports (default: all serial ports).
    """
    if target is not None:
        _check_new(target)
    present = probing.serial_ports()
    candidates = {port: present.get(port, "") for port in map(_device, ports)} or present
    if not candidates:
        raise ConfigError("no serial port: plug in the modem and the receiver, or name a port")
    print(f"probing {', '.join(candidates)}: up to 20 s", file=sys.stderr)
    devices = probing.probe(candidates)
    proposal = probing.propose_config(devices)
    lines = []
    for device in devices:
        rate = f" at {device.baud} baud" if device.baud else ""
        driver = f", driver {device.driver}" if device.driver else ""
        origin = device.usb or "no USB"
        lines.append(f"# {device.port} ({origin}): {device.kind}{rate}{driver} {device.text}")
    show(document.Document(devices, body=[*lines, f"\n{proposal.text.rstrip()}"]), as_json=as_json)
    if target is not None:
        with target.open("x", encoding="utf-8") as file:
            file.write(proposal.text)
    if proposal.advice:
        raise ConfigError(proposal.advice)


def _device(port: str) -> str:
    # a configuration takes complete names only
    if "://" in port:
        return port
    return str(Path(port).absolute() if "/" in port or Path(port).exists() else Path("/dev", port))


def _check_new(path: Path) -> None:
    # before the ports are asked, which takes a while
    if path.exists():
        raise ConfigError(f"{path}: File exists; move it away, or write to another name")
    if not path.parent.is_dir():
        raise ConfigError(f"{path.parent}: no such folder")
    if not os.access(path.parent, os.W_OK):
        raise ConfigError(f"{path.parent}: no permission; use sudo, or name another folder")


@program.command
@click.argument("file", type=INPUT)
@click.option(
    "--driver",
    "driver_name",
    default="auto",
    metavar="NAME",
    cls=NameOption,
    module="logger.drivers.registry",
    variable="FAMILIES",
    help="Family of the modem (default auto: try all).",
)
@click.option("--command", metavar="AT+...", help="The command that the reply answers.")
@json_option
def parse(file: Path, driver_name: str, command: str | None, *, as_json: bool) -> None:
    """Decode a modem's reply.

    FILE contains the text of the reply; - reads standard input.
    """
    chosen = registry.driver_of(driver_name)
    reply = sys.stdin.buffer.read() if str(file) == "-" else file.read_bytes()
    # latin-1 has a character for every byte, so line noise passes unchanged
    lines = re.split(r"[\r\n]+", reply.decode("latin-1"))
    if command:
        lines.insert(0, command)
    driver = chosen or registry.reader_of(lines)
    rows = [reading_rows.as_json(row) for row in transcript.rows_of(driver, lines)]
    texts = [
        "  ".join(f"{name}={value}" for name, value in row.items() if value is not None)
        for row in rows
    ]
    show(document.Document(rows, body=texts), as_json=as_json)
    if not as_json:
        print(f"{document.number_of(len(rows), 'row')}, driver {driver.name}", file=sys.stderr)


@program.command
@click.option(
    "--out",
    "folder",
    type=PATH,
    default=".",
    metavar="DIR",
    help="Folder of the run (default: the current one).",
)
@click.option(
    "--scenario",
    default="block",
    metavar="NAME",
    cls=NameOption,
    module="logger.sim.scenario",
    variable="SCENARIOS",
    help="Simulated walk (default: block).",
)
@click.option(
    "--city",
    "city_name",
    default="graz",
    metavar="NAME",
    cls=NameOption,
    module="logger.sim.scenario",
    variable="CITIES",
    help="City of the walks city-clean and city-rogue (default: graz).",
)
@click.option(
    "--modem",
    "modems",
    default=("sim800",),
    multiple=True,
    metavar="NAME",
    cls=NameOption,
    module="logger.sim.dialects",
    variable="DIALECTS",
    help="Simulated modem (default: sim800), or several, 9 dB apart.",
)
@click.option(
    "--fault",
    metavar="NAME:FROM:TO",
    cls=NameOption,
    module="logger.sim.faults",
    variable="FAULTS",
    help="A fault of the modem between two times in seconds.",
)
@click.option("--seed", type=SEED, default=1, show_default=True, metavar="N")
@click.option(
    "--duration",
    "duration_s",
    type=DURATION_S,
    metavar="S",
    help="Simulated seconds (default: the complete walk).",
)
@click.option(
    "--speed",
    type=number(float, 0, FASTEST, open_below=True),
    metavar="X",
    help="Simulated seconds in a second (default: 20; with --page 5).",
)
@click.option("--follow", "is_led", is_flag=True, help="Walk as the advice says.")
@click.option("--page", "has_page", is_flag=True, help="Serve the phone's page until Ctrl-C.")
@json_option
def simulate(
    folder: Path,
    scenario: str,
    city_name: str,
    modems: tuple[str, ...],
    fault: str | None,
    seed: int,
    duration_s: float | None,
    speed: float | None,
    *,
    is_led: bool,
    has_page: bool,
    as_json: bool,
) -> None:
    """Record a simulated walk; no hardware is needed.

    Modem and receiver are simulated behind pseudo-terminals.
    """
    path = simulation.simulate(
        folder,
        scenario,
        seed,
        duration_s,
        speed or (5.0 if has_page else 20.0),
        modems,
        fault,
        city_name=city_name,
        is_led=is_led,
        page_command=[sys.executable, "-m", "logger.cli", "page"] if has_page else (),
        show_page=lambda url: print(f"the page: {url}", file=sys.stderr),
    )
    show(document.Document({"run": path}, body=[str(path)]), as_json=as_json)


if __name__ == "__main__":
    sys.exit(main())
