"""The command `postproc`: what a walker types at the desk."""

import argparse
import json
import os
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from logger.core.arguments import height, input_path, path
from logger.core.errors import FieldLoggerError
from logger.core.printable import plain_streams, printable
from postproc.interop import cli as interop
from postproc.pictures import cli as pictures
from postproc.report import cli as report
from postproc.reproductions.toa import cli as toa
from postproc.reproductions.validate import cli as validate
from postproc.verification import cli as verify
from postproc.view import cli as view

if TYPE_CHECKING:
    from logger.core.runfile import Run


def main(argv: list[str] | None = None) -> int:
    """Run a command; a user's mistake is one line on stderr and exit 2."""
    with plain_streams():
        return _main(argv)


def _main(argv: list[str] | None) -> int:
    # the matrices are small: threads of BLAS would wait for each other, on a busy machine longer
    # than they work
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    try:
        arguments = _parser().parse_args(argv)
        code: int = arguments.command(arguments)
    except FieldLoggerError as error:
        print(f"postproc: {printable(str(error))}", file=sys.stderr)
        return 2
    except ModuleNotFoundError as error:
        if error.name is None or error.name.startswith(("logger", "postproc")):
            raise
        # the plain install is the logger; the desk's libraries are an extra, and the viewer's
        # another
        extra = (
            "view" if error.name.partition(".")[0] in {"rerun", "rerun_cli", "pyarrow"} else "post"
        )
        print(
            f"postproc: {error.name} is missing: pip install 'cellwalk[{extra}]'", file=sys.stderr
        )
        return 2
    except BrokenPipeError:
        return 0
    # a file that vanishes, a name too long, a full disk: where no command says it better
    except OSError as error:
        what = printable(f"{error.filename or ''}: {error.strerror or error}".removeprefix(": "))
        print(f"postproc: {what}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130
    return code


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="postproc", description="Find where the cells of a recorded walk stand."
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    def add(
        name: str, what: str, *, run: bool = True, several: bool = False
    ) -> argparse.ArgumentParser:
        command = commands.add_parser(name, help=what)
        if run:
            which, count = "run-....h5, or a journal that was cut", "+" if several else None
            command.add_argument("run", type=input_path, nargs=count, metavar="RUN", help=which)
        return command

    _add_info(add("info", "what is in a run, its gaps, how it stopped"))

    replay = add("replay", "compute the live estimate again and compare it with the recorded one")
    replay.add_argument("--json", action="store_true")
    replay.set_defaults(command=_replay)

    smooth = add(
        "smooth",
        "estimate where each cell stands, and how sure that is; several runs together",
        several=True,
    )
    smooth.add_argument(
        "--cell", action="append", metavar="NAME", help="only this cell (may be repeated)"
    )
    smooth.add_argument(
        "--environment", default="any", help="prior: any (default), open, suburban or urban"
    )
    smooth.add_argument(
        "--height",
        type=height("--height"),
        metavar="M",
        help="antenna above the receiver (default: 5 m)",
    )
    losses = ("linear", "soft_l1", "huber", "cauchy")
    smooth.add_argument(
        "--loss", choices=losses, default="linear", help="loss of the least-squares fit"
    )
    smooth.add_argument(
        "-v", "--verbose", action="store_true", help="every cell with all that is known of it"
    )
    smooth.add_argument("--json", action="store_true")
    smooth.set_defaults(command=_smooth)

    imports = add("import", "make a run of what another program recorded", run=False)
    interop.add_import(imports)
    imports.set_defaults(command=interop.import_)

    exports = add("export", "write levels, track and estimates for maps, tables and cell databases")
    interop.add_export(exports)
    exports.set_defaults(command=_export)

    share = add(
        "share", "a copy to give away: without the ends of the walk, raw bytes and configuration"
    )
    interop.add_share(share)
    share.set_defaults(command=interop.share)

    view.add_view(
        add("view", "show runs or a saved recording in rerun, or in a browser here", several=True)
    )

    pictures.add_plot(add("plot", "draw a run as a picture"))
    report.add_report(add("report", "a page that tells a run, or several together", several=True))

    recover = add(
        "recover",
        "make HDF5 of what a pulled plug left behind; exit 3 where something was lost",
        run=False,
    )
    recover.add_argument("path", type=path, metavar="PATH", help="a journal, or a folder of runs")
    recover.add_argument("--json", action="store_true")
    recover.set_defaults(command=_recover)

    toa.add_toa(
        commands.add_parser(
            "toa", help="place by ranges to anchors: the README's Kalman filter, simulated"
        )
    )
    what = "check the specification, item by item: claim, what we measured, verdict"
    validate.add_validate(commands.add_parser("validate", help=what))

    verify.add_verify(
        add(
            "verify",
            "test claimed positions of cells: consistent, rejected or cannot tell, with the power",
        )
    )
    verify.add_theory(
        commands.add_parser(
            "verify-theory", help="position verification by theory, and by simulation"
        )
    )
    verify.add_celldb(
        commands.add_parser("celldb", help="OpenCelliD and Mozilla exports as one indexed file")
    )

    what = 'completion for a shell: eval "$(postproc completion bash)"'
    completion = commands.add_parser("completion", help=what)
    completion.add_argument("shell", choices=("bash", "zsh", "fish", "tcsh"))
    completion.set_defaults(command=_completion)
    return parser


def _add_info(info: argparse.ArgumentParser) -> None:
    info.add_argument(
        "--verify",
        action="store_true",
        help="check that it is whole and as it was sealed; 3 if not",
    )
    what = "with --verify: the digest noted at the stop, which a forger cannot meet"
    info.add_argument("--digest", metavar="HEX", help=what)
    info.add_argument("-v", "--verbose", action="store_true", help="every gap and every event")
    info.add_argument("--json", action="store_true")
    info.set_defaults(command=_info)


def _info(arguments: argparse.Namespace) -> int:
    from logger.core.runfile import read_sound_run
    from postproc.info import describe
    from postproc.info_table import print_info
    from postproc.json_text import as_json

    if arguments.verify or arguments.digest is not None:
        return _verify(arguments)
    info = describe(read_sound_run(arguments.run))
    if arguments.json:
        print(as_json(info))
    else:
        print_info(info, details=arguments.verbose)
    return 0


def _verify(arguments: argparse.Namespace) -> int:
    from dataclasses import asdict

    from logger.core.runfile import SOMETHING_LOST
    from postproc.info import noted_digest, verify

    checks = verify(
        arguments.run, None if arguments.digest is None else noted_digest(arguments.digest)
    )
    if arguments.json:
        print(json.dumps([asdict(check) for check in checks], indent=2))
    else:
        for check in checks:
            print(f"{'ok' if check.holds else 'FAIL':4}  {check.what}: {printable(check.text)}")
    return 0 if all(check.holds for check in checks) else SOMETHING_LOST


def _replay(arguments: argparse.Namespace) -> int:
    from dataclasses import asdict

    from logger.core.runfile import read_run
    from postproc.replay import replay

    found = replay(read_run(arguments.run))
    if arguments.json:
        print(json.dumps(asdict(found) | {"equal": found.equal}, indent=2))
    elif not found.n_recorded and not found.n_replayed:
        print(
            "the run holds no live estimate: there was never a decoded 2G cell together with a fix"
        )
    elif found.equal:
        print(f"replay equals live: {found.n_equal} estimates, to the last bit")
    else:
        print(
            f"replay differs from live: {found.n_recorded} recorded, {found.n_replayed} replayed, "
            f"{found.n_equal} equal; first difference at record {found.first_difference}, "
            f"largest {found.largest_m:.3g} m"
        )
    return 0 if found.equal else 1


def _smooth(arguments: argparse.Namespace) -> int:
    from logger.core.model.prior import prior_for
    from logger.core.runfile import read_sound_run
    from postproc import results
    from postproc.progress import shown
    from postproc.result import Options
    from postproc.smoothing import smooth_runs

    options = Options(prior_for(arguments.environment, height_m=arguments.height), arguments.loss)
    runs = [read_sound_run(path) for path in arguments.run]
    result = smooth_runs(
        runs, arguments.cell, options=options, progress=shown, processes=_processes()
    )
    found = results.summary(result)
    _print_results(arguments, found)
    # printed first: a run on a card that cannot be written has an answer too
    beside = results.path_beside(arguments.run[0], together=len(runs) > 1)
    results.write(result, found, beside)
    return 0


def _print_results(arguments: argparse.Namespace, found: dict[str, Any]) -> None:
    from postproc.json_text import as_json
    from postproc.tables import print_summary

    if arguments.json:
        print(as_json(found))
    else:
        print_summary(found, details=bool(arguments.cell or arguments.verbose))


def _export(arguments: argparse.Namespace) -> int:
    from postproc.progress import shown
    from postproc.results import summary
    from postproc.smoothing import smooth_runs

    def summarise(run: "Run", only: Sequence[str] | None) -> dict[str, Any]:
        return summary(smooth_runs([run], only, progress=shown, processes=_processes()))

    return interop.export(arguments, summarise)


def _completion(arguments: argparse.Namespace) -> int:
    from postproc.completion import script

    print(script(_parser(), arguments.shell))
    return 0


def _recover(arguments: argparse.Namespace) -> int:
    from logger.core.runfile import SOMETHING_LOST, recover

    found = []
    for recovered in recover(arguments.path):
        found.append(recovered)
        if arguments.json:
            continue
        print(recovered, flush=True)
        if recovered.loss:
            print(f"postproc: {recovered.loss}", file=sys.stderr)
    if arguments.json:
        print(json.dumps([one.as_dict() for one in found], indent=2))
    return SOMETHING_LOST if any(recovered.loss for recovered in found) else 0


def _processes() -> int:
    return os.cpu_count() or 1


if __name__ == "__main__":
    sys.exit(main())
