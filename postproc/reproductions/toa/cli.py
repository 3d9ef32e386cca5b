"""The command `toa` of `postproc`."""

import argparse

from logger.core.arguments import file_path


def add_toa(toa: argparse.ArgumentParser) -> None:
    simulate = toa.add_subparsers(required=True, metavar="COMMAND").add_parser(
        "simulate", help="mean errors by noise"
    )
    simulate.add_argument(
        "--runs", type=int, default=10_000, metavar="N", help="simulated runs (default: 10000)"
    )
    simulate.add_argument("--seed", type=int, default=0, metavar="N")
    simulate.add_argument(
        "--anchors", metavar='"X,Y X,Y ..."', help="anchors in metres (default: the README's four)"
    )
    simulate.add_argument(
        "--path", metavar='"X,Y X,Y ..."', help="places of the object (default: (k, k), k = 0..10)"
    )
    simulate.add_argument(
        "--sigma2",
        type=float,
        nargs="+",
        metavar="M2",
        help="variances of a range (default: 0.01 ... 100)",
    )
    simulate.add_argument("--steps", action="store_true", help="errors of each step as well")
    simulate.add_argument(
        "--plot", type=file_path, metavar="FILE", help="draw the errors (.png, .svg, .pdf)"
    )
    simulate.add_argument("--json", action="store_true")
    simulate.set_defaults(command=_toa_simulate)


def _toa_simulate(arguments: argparse.Namespace) -> int:
    from postproc.progress import shown
    from postproc.reproductions.toa import report
    from postproc.reproductions.toa.simulate import setting, simulate

    wanted = setting(
        report.places(arguments.anchors) if arguments.anchors is not None else None,
        report.places(arguments.path) if arguments.path is not None else None,
        arguments.sigma2,
        arguments.runs,
        arguments.seed,
    )
    if arguments.plot is not None:
        from postproc.picture_file import check_picture

        check_picture(arguments.plot)
    rows = list(shown(simulate(wanted), "simulating", len(wanted.sigma2_m2)))
    if arguments.json:
        print(report.as_json(wanted, rows, steps=arguments.steps))
    else:
        report.print_rows(wanted, rows, steps=arguments.steps)
    if arguments.plot is not None:
        from postproc.reproductions.toa.picture import draw

        draw(wanted, rows, arguments.plot)
    return 0
