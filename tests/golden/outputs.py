"""What every command prints: its help, and its JSON about walks that are made anew each time.

`python -m tests.golden.outputs` writes the expected outputs beside this file, after a change that
was meant. The test compares them with what the commands print.
"""

import contextlib
import gzip
import io
import json
import os
import re
import shutil
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click

from logger import cli as logger_cli
from logger.core.runfile import finish_journal
from postproc import cli as postproc_cli
from postproc.verification.celldb import COLUMNS
from tests.kit.runs import UTC0_NS
from tests.kit.sample_results import LAT, LON, write_run

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
HELP = HERE / "help.txt"
DOCUMENTS = HERE / "json"
PROGRAMS = {"fieldlogger": logger_cli, "postproc": postproc_cli}

COMMANDS = {  # in this order: some make files for later ones
    "recover": "postproc recover DIR/recovered",
    "info": "postproc info DIR/a.h5",
    "info-verify": "postproc info --verify DIR/a.h5",
    "replay": "postproc replay DIR/a.h5",
    "smooth": "postproc smooth DIR/a.h5",
    "smooth-several": "postproc smooth DIR/a.h5 DIR/b.h5",
    "export": "postproc export DIR/a.h5 -o DIR/a.kml --estimates",
    "export-csv": "postproc export DIR/a.h5 -o DIR/a.csv",
    "import": "postproc import DIR/a.csv -o DIR/imported.h5",
    "share": "postproc share DIR/long.h5 -o DIR/shared.h5 --blur-m 10",
    "plot": "postproc plot DIR/a.h5",
    "report": "postproc report DIR/a.h5",
    "next": "postproc next DIR/a.h5",
    "suspect": "postproc suspect DIR/a.h5",
    "compare": "postproc compare DIR/a.h5 DIR/b.h5",
    "celldb-import": "postproc celldb import DIR/cells.csv.gz -o DIR/cells.db",
    "celldb-lookup": f"postproc celldb lookup DIR/cells.db --near {LAT},{LON}",
    "verify": f"postproc verify DIR/a.h5 --claim {LAT},{LON} --cell 262-01-4711-100",
    "verify-claims": "postproc verify DIR/a.h5 --claims DIR/cells.db",
    "verify-sites": "postproc verify DIR/a.h5 --sites --cell 262-01-4711-100",
    "baseline-add": "postproc baseline add DIR/a.h5 DIR/b.h5 -b DIR/baseline.db",
    "baseline-trust": "postproc baseline trust 262-01-4711-100 own -b DIR/baseline.db",
    "baseline-list": "postproc baseline list -b DIR/baseline.db",
    "baseline-remove": "postproc baseline remove 1 -b DIR/baseline.db",
    "survey-add": "postproc survey add DIR/a.h5 DIR/b.h5 -o DIR/survey",
    "survey-locate": "postproc survey locate DIR/survey",
    "survey-diff": "postproc survey diff DIR/survey --before 2026-09-25",
    "survey-baseline": "postproc survey baseline DIR/survey -b DIR/survey.db",
    "survey-map": "postproc survey map DIR/survey",
    "survey-next": "postproc survey next DIR/survey",
    "view": "postproc view DIR/a.h5 --save DIR/a.rrd",
    "verify-theory": "postproc validate theory --trials 2000",
    "toa-simulate": "postproc validate toa --runs 20 --sigma2 1 100 --steps",
    "check": "fieldlogger check --config DIR/site.toml",
    "learn": "fieldlogger learn --config DIR/site.toml",
    "forget": "fieldlogger forget all --config DIR/site.toml",
    "trust": "fieldlogger trust 262-01-4711-100 own --config DIR/site.toml",
    "probe": "fieldlogger probe DIR/no-port",
    "parse": "fieldlogger parse DIR/reply.txt",
    "simulate": "fieldlogger simulate --out DIR/simulated --duration 20 --speed 20",
    "logger-recover": "fieldlogger recover DIR/recovered",
    "status": "fieldlogger status",
}
NO_GOLDEN = {
    "postproc completion": "a script of click",
    "postproc validate spec": "takes 20 s: tests/postproc/reproductions/test_cli.py",
    "postproc guide": "prints JSON alone: tests/postproc/guidance/test_cli.py",
    "fieldlogger run": "prints no JSON",
    "fieldlogger page": "prints no JSON",
    "fieldlogger doctor": "examines this machine; its lines are those of check",
}
LATER_NS = UTC0_NS + 10 * 86_400 * 10**9
"""The second walk begins ten days after the others, on another side of the date of `diff`."""
BY_MACHINE = {"share", "check", "probe", "status"}
"""Of these only the names and types of the fields are compared; `share` draws its borders."""
VARYING = {
    "modem",
    "bytes",
    "seconds",
    "program",
    "recorded_by",
    "replayed_by",
    "versions",
    "run_id",
}
"""Fields whose values depend on the machine, the time, the release or on salt."""
_VARYING_TEXT = re.compile(r"\b[0-9a-f]{32,64}\b|cellwalk [0-9][\w.+]*|run-[\w-]+\.h5")


def commands() -> Iterator[tuple[str, click.Command]]:
    """Every command and group with its full name."""

    def below(name: str, command: click.Command) -> Iterator[tuple[str, click.Command]]:
        yield name, command
        if isinstance(command, click.Group):
            context = click.Context(command)
            for inner in command.list_commands(context):
                found = command.get_command(context, inner)
                assert found is not None
                yield from below(f"{name} {inner}", found)

    for name, module in PROGRAMS.items():
        yield from below(name, module.program)


def helps() -> str:
    """`--help` of every command, one after the other."""
    parts = []
    for name, _ in commands():
        program, *words = name.split()
        code, text = output_of(program, [*words, "--help"])
        assert code == 0, text
        parts.append(f"$ {name} --help\n{text}")
    return "\n".join(parts)


def output_of(program: str, arguments: list[str]) -> tuple[int, str]:
    """Exit code and standard output of a command, run in this process."""
    output = io.StringIO()
    with contextlib.redirect_stdout(output), contextlib.redirect_stderr(io.StringIO()):
        code = PROGRAMS[program].main(arguments)
    return code, output.getvalue()


def write_inputs(folder: Path) -> None:
    """The files that the commands name."""
    for name, run in {
        "a": {"seconds": 160, "cells": 2, "run_id": "a" * 32},
        "b": {
            "seconds": 150,
            "cells": 2,
            "run_id": "b" * 32,
            "speed_mps": 1.1,
            "utc0_ns": LATER_NS,
        },
        "long": {"seconds": 300, "cells": 1, "run_id": "c" * 32},
    }.items():
        write_run(folder / f"{name}.journal", **run)
        finish_journal(folder / f"{name}.journal")
    (folder / "recovered").mkdir()
    write_run(folder / "recovered/run-000001.journal", seconds=60, cells=1, run_id="d" * 32)
    (folder / "simulated").mkdir()
    row = f"GSM,262,1,4711,100,0,{LON},{LAT},1000,7,1,1282569574,1300155341,0\n"
    with gzip.open(folder / "cells.csv.gz", "wt") as cells:
        cells.write(",".join(COLUMNS) + "\n" + row)
    shutil.copy(ROOT / "tests/drivers/data/sitch_sim800l_mode2.txt", folder / "reply.txt")
    shutil.copy(ROOT / "systemd/site.toml", folder / "site.toml")


def documents(folder: Path) -> Iterator[tuple[str, Any]]:
    """Exit code and JSON document of every command; the paths in it begin with DIR."""
    write_inputs(folder)
    environment = os.environ | {"RUNTIME_DIRECTORY": str(folder / "no-service")}
    for name, line in COMMANDS.items():
        program, *words = line.replace("DIR", str(folder)).split()
        with _environment(environment):
            code, text = output_of(program, [*words, "--json"])
        document = json.loads(text.replace(str(folder), "DIR"))
        if name in BY_MACHINE:
            document = shape_of(document)
            code = None
        yield name, {"command": line, "exit_code": code, "document": plain(document)}


@contextlib.contextmanager
def _environment(wanted: dict[str, str]) -> Iterator[None]:
    before = dict(os.environ)
    os.environ.update(wanted)
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)


def plain(value: Any) -> Any:
    """A document without what differs by machine and time."""
    if isinstance(value, dict):
        return {key: "-" if key in VARYING else plain(one) for key, one in value.items()}
    if isinstance(value, list):
        return [plain(one) for one in value]
    return _VARYING_TEXT.sub("-", value) if isinstance(value, str) else value


def shape_of(value: Any) -> Any:
    """Names of fields and types of values; of a list those of its first element."""
    if isinstance(value, dict):
        return {key: shape_of(one) for key, one in value.items()}
    if isinstance(value, list):
        return [shape_of(one) for one in value[:1]]
    return type(value).__name__


def main() -> None:
    """Write the expected outputs."""
    HELP.write_text(helps(), encoding="utf-8")
    shutil.rmtree(DOCUMENTS, ignore_errors=True)
    DOCUMENTS.mkdir()
    with tempfile.TemporaryDirectory() as folder:
        for name, document in documents(Path(folder)):
            text = json.dumps(document, indent=1, ensure_ascii=False)
            (DOCUMENTS / f"{name}.json").write_text(f"{text}\n", encoding="utf-8")
            print(name, file=sys.stderr)


if __name__ == "__main__":
    main()
