"""The command `fieldlogger`: what a walker types on the Pi."""

import argparse
import json
import logging
import os
import re
import sys
from dataclasses import asdict
from pathlib import Path

from logger.core.errors import ConfigError, FieldLoggerError


def main(argv: list[str] | None = None) -> int:
    """Run a command; a user's mistake is one line on stderr and exit 2."""
    # the locator's matrices are small: threads of BLAS would only wait for each other
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    arguments = _parser().parse_args(argv)
    logging.basicConfig(level=logging.INFO, format="%(levelname)s %(message)s", stream=sys.stderr)
    try:
        code: int = arguments.command(arguments)
    except FieldLoggerError as error:
        print(f"fieldlogger: {error}", file=sys.stderr)
        return 2
    except BrokenPipeError:
        return 0
    return code


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="fieldlogger", description="Record cells and fixes of a walk. It only listens."
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    run = commands.add_parser("run", help="record until stopped (SIGTERM, SIGINT) or unplugged")
    run.add_argument("--config", type=Path, required=True, metavar="SITE.TOML")
    run.add_argument("--duration", type=float, metavar="S", help="stop cleanly after so many seconds")
    run.set_defaults(command=_run)

    check = commands.add_parser("check", help="check the configuration and the installation, without opening a port")
    check.add_argument("--config", type=Path, metavar="SITE.TOML")
    check.add_argument("--json", action="store_true")
    check.set_defaults(command=_check)

    parse = commands.add_parser("parse", help="show what a modem's reply means")
    parse.add_argument("--driver", required=True, metavar="NAME", help="family of the modem, e.g. sim800")
    parse.add_argument("file", type=Path, metavar="FILE", help="text of the reply, - for stdin")
    parse.add_argument("--json", action="store_true")
    parse.set_defaults(command=_parse)

    recover = commands.add_parser("recover", help="make HDF5 of the journals that a pulled plug left behind")
    recover.add_argument("folder", type=Path, metavar="DIR")
    recover.set_defaults(command=_recover)

    simulate = commands.add_parser("simulate", help="record a simulated walk through real ptys, no hardware needed")
    simulate.add_argument("--out", type=Path, default=Path(), metavar="DIR", help="folder of the run (default: here)")
    simulate.add_argument("--scenario", default="block", metavar="NAME")
    simulate.add_argument("--seed", type=int, default=1)
    simulate.add_argument("--duration", type=_positive, metavar="S", help="simulated seconds (default: the whole walk)")
    simulate.add_argument(
        "--speed", type=_positive, default=20.0, metavar="X", help="times faster than real (default 20)"
    )
    simulate.set_defaults(command=_simulate)
    return parser


def _positive(text: str) -> float:
    value = float(text)
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError("must be more than 0")
    return value


def _run(arguments: argparse.Namespace) -> int:
    from logger.config import load_config
    from logger.device.clock import SystemClock
    from logger.device.service import run_service

    config, text = load_config(arguments.config)
    print(run_service(config, text, SystemClock(), arguments.duration))
    return 0


def _check(arguments: argparse.Namespace) -> int:
    from logger.check import check

    lines = check(arguments.config)
    if arguments.json:
        print(json.dumps([asdict(line) for line in lines], indent=2))
    else:
        for line in lines:
            print(f"{line.state:4}  {line.what}: {line.text}")
    return 2 if any(line.state == "fail" for line in lines) else 0


def _parse(arguments: argparse.Namespace) -> int:
    from logger.drivers.registry import make_driver

    driver = make_driver(arguments.driver)
    # latin-1 has a character for every byte, so that noise in a transcript stays noise
    lines = re.split(r"[\r\n]+", _bytes_of(arguments.file).decode("latin-1"))
    readings = driver.read_lines(lines)
    if arguments.json:
        print(json.dumps([asdict(reading) for reading in readings], indent=2))
        return 0
    for reading in readings:
        known = {name: value for name, value in asdict(reading).items() if value is not None}
        print("  ".join(f"{name}={value}" for name, value in known.items()))
    print(f"{len(readings)} readings", file=sys.stderr)
    return 0


def _bytes_of(path: Path) -> bytes:
    try:
        return sys.stdin.buffer.read() if str(path) == "-" else path.read_bytes()
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from error


def _recover(arguments: argparse.Namespace) -> int:
    from logger.device.service import recover_folder

    if not arguments.folder.is_dir():
        raise ConfigError(f"{arguments.folder}: no such folder")
    for run in recover_folder(arguments.folder):
        print(run)
    return 0


def _simulate(arguments: argparse.Namespace) -> int:
    from logger.simulate import simulate

    run = simulate(arguments.out, arguments.scenario, arguments.seed, arguments.duration, arguments.speed)
    print(run)
    return 0


if __name__ == "__main__":
    sys.exit(main())
