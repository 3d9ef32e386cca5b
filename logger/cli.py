"""The command `fieldlogger`: what a walker types on the Pi."""

import argparse
import json
import logging
import os
import re
import sys
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from logger.core.arguments import input_path, number, path, seconds, whole
from logger.core.errors import ConfigError, FieldLoggerError
from logger.core.printable import plain_streams, printable

if TYPE_CHECKING:
    from logger.check import Line


FASTEST = 1e4
"""No machine simulates a walk so fast."""


def main(argv: list[str] | None = None) -> int:
    """Run a command; a user's mistake is one line on stderr and exit 2."""
    with plain_streams():
        return _main(argv)


def _main(argv: list[str] | None) -> int:
    # the locator's matrices are small: threads of BLAS would only wait for each other
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    logging.basicConfig(level=logging.INFO, format="%(levelname)s %(message)s", stream=sys.stderr)
    try:
        arguments = _parser().parse_args(argv)
        code: int = arguments.command(arguments)
    except FieldLoggerError as error:
        print(f"fieldlogger: {printable(str(error))}", file=sys.stderr)
        return 2
    except BrokenPipeError:
        return 0
    # a file that vanishes, a name too long, a full disk: where no command says it better
    except OSError as error:
        what = printable(f"{error.filename or ''}: {error.strerror or error}".removeprefix(": "))
        print(f"fieldlogger: {what}", file=sys.stderr)
        return 2
    return code


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="fieldlogger", description="Record cells and fixes of a walk. It only listens."
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    run = commands.add_parser("run", help="record until stopped (SIGTERM, SIGINT) or unplugged")
    run.add_argument("--config", type=path, required=True, metavar="SITE.TOML")
    run.add_argument(
        "--duration",
        type=seconds("--duration"),
        metavar="S",
        help="stop cleanly after so many seconds",
    )
    run.set_defaults(command=_run)

    check = commands.add_parser(
        "check", help="check the configuration and the installation, without opening a port"
    )
    check.add_argument("--config", type=path, metavar="SITE.TOML")
    check.add_argument("--json", action="store_true")
    check.set_defaults(command=_check)

    doctor = commands.add_parser(
        "doctor", help="is it working? power, disk, ports, modem, receiver, line by line"
    )
    doctor.add_argument(
        "--config", type=path, default=Path("/etc/cellwalk/site.toml"), metavar="SITE.TOML"
    )
    what = "length of the trial (default 15)"
    doctor.add_argument(
        "--seconds", type=seconds("--seconds"), default=15.0, metavar="S", help=what
    )
    doctor.add_argument("--json", action="store_true")
    doctor.set_defaults(command=_doctor)

    probe = commands.add_parser(
        "probe", help="find modem and receiver on the serial ports, propose a site.toml"
    )
    probe.add_argument(
        "ports", nargs="*", metavar="PORT", help="look at these only (default: all there are)"
    )
    probe.add_argument(
        "--write", type=path, metavar="SITE.TOML", help="write the proposal; never over a file"
    )
    probe.add_argument("--json", action="store_true")
    probe.set_defaults(command=_probe)

    parse = commands.add_parser("parse", help="show what a modem's reply means")
    parse.add_argument(
        "--driver",
        default="auto",
        metavar="NAME",
        help="family of the modem (default auto: try all)",
    )
    parse.add_argument(
        "--command", dest="command_line", metavar="AT+...", help="the command that it answers"
    )
    parse.add_argument(
        "file", type=input_path, metavar="FILE", help="text of the reply, - for stdin"
    )
    parse.add_argument("--json", action="store_true")
    parse.set_defaults(command=_parse)

    recover = commands.add_parser(
        "recover", help="make HDF5 of the journals that a pulled plug left behind"
    )
    recover.add_argument(
        "path", type=path, metavar="DIR", help="folder of the runs, or one journal"
    )
    recover.add_argument("--json", action="store_true")
    recover.set_defaults(command=_recover)

    simulate = commands.add_parser(
        "simulate", help="record a simulated walk through real ptys, no hardware needed"
    )
    simulate.add_argument(
        "--out", type=path, default=Path(), metavar="DIR", help="folder of the run (default: here)"
    )
    simulate.add_argument("--scenario", default="block", metavar="NAME")
    simulate.add_argument(
        "--modem", default="sim800", metavar="NAME", help="simulated modem (default sim800)"
    )
    simulate.add_argument(
        "--fault", metavar="NAME:FROM:TO", help="let the modem misbehave, times in seconds"
    )
    simulate.add_argument("--seed", type=whole("--seed", 0, 2**63 - 1), default=1)
    what = "simulated seconds (default: the whole walk)"
    simulate.add_argument("--duration", type=seconds("--duration"), metavar="S", help=what)
    speed = number("--speed", 0.0, FASTEST, open_below=True)
    what = "times faster than real (default 20)"
    simulate.add_argument("--speed", type=speed, default=20.0, metavar="X", help=what)
    simulate.add_argument("--json", action="store_true")
    simulate.set_defaults(command=_simulate)
    return parser


def _run(arguments: argparse.Namespace) -> int:
    from logger.config import load_config
    from logger.device.clock import SystemClock
    from logger.device.notify import ServiceManager
    from logger.device.signals import stop_signals
    from logger.device.startup import begin_run

    config, text = load_config(arguments.config)
    clock, manager = SystemClock(), ServiceManager.of(os.environ)
    with stop_signals() as stop:
        begun = begin_run(config, text, clock)  # before anything is imported that takes time
        if begun.writer.is_durable:
            manager.alive()
        from logger.device.service import run_service

        print(run_service(config, begun, manager, clock, stop, arguments.duration))
    return 0


def _check(arguments: argparse.Namespace) -> int:
    from logger.check import check

    return _print_lines(check(arguments.config), as_json=arguments.json)


def _doctor(arguments: argparse.Namespace) -> int:
    from logger.doctor import examine

    logging.getLogger().setLevel(logging.ERROR)  # the lines say it better than the service's log
    return _print_lines(examine(arguments.config, arguments.seconds), as_json=arguments.json)


def _print_lines(lines: "Iterable[Line]", *, as_json: bool) -> int:
    """Print what was checked, each line as it is found; 2 where one has failed."""
    found = []
    for line in lines:
        found.append(line)
        if not as_json:
            print(f"{line.state:4}  {line.what}: {line.text}", flush=True)
    if as_json:
        print(json.dumps([asdict(line) for line in found], indent=2))
    return 2 if any(line.state == "fail" for line in found) else 0


def _probe(arguments: argparse.Namespace) -> int:
    from logger.probe import probe, propose_config, serial_ports

    there = serial_ports()
    ports = {port: there.get(port, "") for port in arguments.ports} or there
    if not ports:
        raise ConfigError(
            "there is no serial port; plug the modem and the receiver in, or name a port"
        )
    print(f"looking at {', '.join(ports)}: up to 20 s", file=sys.stderr)
    found = probe(ports)
    proposal = propose_config(found)
    if arguments.json:
        print(json.dumps([asdict(one) for one in found], indent=2))
    else:
        for one in found:
            rate = f" at {one.baud} baud" if one.baud else ""
            driver = f", driver {one.driver}" if one.driver else ""
            print(f"# {one.port} ({one.usb or 'no USB'}): {one.kind}{rate}{driver} {one.text}")
        print(f"\n{proposal.text}", end="")
    if arguments.write is not None:
        _write_new(arguments.write, proposal.text)
    if proposal.advice:
        raise ConfigError(proposal.advice)
    return 0


def _write_new(path: Path, text: str) -> None:
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError as error:
        raise ConfigError(
            f"{path}: {error.strerror}; move it away, or write to another name"
        ) from error
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from error


def _parse(arguments: argparse.Namespace) -> int:
    from logger.drivers.reading.rows import as_json
    from logger.drivers.registry import driver_of, reader_of
    from logger.drivers.transcript import rows_of

    chosen = driver_of(arguments.driver)
    # latin-1 has a character for every byte, so that noise in a transcript stays noise
    lines = re.split(r"[\r\n]+", _bytes_of(arguments.file).decode("latin-1"))
    if arguments.command_line:
        lines.insert(0, arguments.command_line)
    driver = chosen or reader_of(lines)
    rows = [as_json(row) for row in rows_of(driver, lines)]
    if arguments.json:
        print(json.dumps(rows, indent=2))
        return 0
    for row in rows:
        print("  ".join(f"{name}={value}" for name, value in row.items() if value is not None))
    print(f"{len(rows)} rows, driver {driver.name}", file=sys.stderr)
    return 0


def _bytes_of(path: Path) -> bytes:
    try:
        return sys.stdin.buffer.read() if str(path) == "-" else path.read_bytes()
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from error


def _recover(arguments: argparse.Namespace) -> int:
    from logger.core.runfile import SOMETHING_LOST, recover

    found = []
    for recovered in recover(arguments.path):
        found.append(recovered)
        if arguments.json:
            continue
        print(recovered, flush=True)
        if recovered.loss:
            print(f"fieldlogger: {recovered.loss}", file=sys.stderr)
    if arguments.json:
        print(json.dumps([one.as_dict() for one in found], indent=2))
    return SOMETHING_LOST if any(recovered.loss for recovered in found) else 0


def _simulate(arguments: argparse.Namespace) -> int:
    from logger.simulate import simulate

    told = (
        arguments.scenario,
        arguments.seed,
        arguments.duration,
        arguments.speed,
        arguments.modem,
        arguments.fault,
    )
    run = simulate(arguments.out, *told)
    print(json.dumps({"run": str(run)}) if arguments.json else run)
    return 0


if __name__ == "__main__":
    sys.exit(main())
