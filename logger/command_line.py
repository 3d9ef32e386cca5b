"""Shared parts of the programs `fieldlogger` and `postproc`: argument types, options, exit codes.

A mistake of the user is one line on stderr and exit code 2; no exception leaves `run_program`.
"""

import copy
import os
import shlex
import shutil
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial, wraps
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from importlib.util import LazyLoader
from pathlib import Path
from types import ModuleType
from typing import Any, NoReturn, TextIO, TypeVar

import click
from click.shell_completion import shell_complete

from logger.core.errors import SOMETHING_LOST, FieldLoggerError
from logger.core.printable import plain_streams, printable


class _LateLoader(SourceFileLoader):
    """Finds our own modules, which then run at their first use."""

    @classmethod
    def find_spec(
        cls, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if not fullname.startswith(("logger.", "postproc.")):
            return None
        spec = PathFinder.find_spec(fullname, path, target)
        if spec is not None and isinstance(spec.loader, SourceFileLoader):
            spec.loader = LazyLoader(cls(fullname, spec.loader.path))
        return spec

    def exec_module(self, module: ModuleType) -> None:
        try:
            super().exec_module(module)
        except (ImportError, KeyboardInterrupt) as error:
            # where `from module import name` is the first use, Python drops the error of the run
            # and asks the half-made module for the name, which must not be there yet
            names, spec = module.__dict__, module.__spec__
            names.clear()
            names.update(__getattr__=partial(_raise, error), __spec__=spec)  # 3.13 uses the latter
            raise


def _raise(error: BaseException, _: str) -> NoReturn:
    raise error


@contextmanager
def late_modules() -> Iterator[None]:
    """Import modules that run when a command first uses them: `from package import module`.

    So the help of a command imports no library. A name of a module (`from module import name`) is a
    use.
    """
    sys.meta_path.insert(0, _LateLoader)
    try:
        yield
    finally:
        sys.meta_path.remove(_LateLoader)


def run_now(*modules: ModuleType) -> None:
    """Run late modules, so that a missing library is an error before long work."""
    for module in modules:
        getattr(module, "__file__", None)


with late_modules():
    from logger.core import document, foreign, runfile

Real = TypeVar("Real", bound=float)

SITE_TOML = Path("/etc/cellwalk/site.toml")
SERVICE_FOLDER = Path("/var/lib/cellwalk")
"""Where systemd/fieldlogger.service keeps runs."""

MOST_S = 1_000_000_000
"""30 years. A longer time is a typing error, and nanoseconds of this one fit into 64 bits."""

INTERRUPTED = 130
"""Exit code after Ctrl-C, as a shell reports it (128 + SIGINT)."""


class PathType(click.Path):
    """A path; with `is_file` one that names a file, with `is_input` one that can also be read.

    `/` and `..` name no file, nor does `-` to write to. A pipe or a device may never end; a folder
    has no content.
    """

    def __init__(self, *, is_file: bool = False, is_input: bool = False) -> None:
        super().__init__(path_type=Path)
        self._is_file = is_file or is_input
        self._is_input = is_input

    def convert(
        self,
        value: str | os.PathLike[str],
        param: click.Parameter | None,
        ctx: click.Context | None,
    ) -> Path:
        path = Path(value)
        if "\0" in str(path):
            self.fail(f"{str(path)!r} contains a NUL character", param, ctx)
        nameless = {"", ".."} if self._is_input else {"", "..", "-"}
        if self._is_file and path.name in nameless:
            self.fail(f"{str(path)!r} names no file", param, ctx)
        if self._is_input and path.exists():
            try:
                foreign.check_regular(path)
            except OSError as error:
                self.fail(f"{path}: {error.strerror}", param, ctx)
        return path


def number(
    parse: Callable[[str], Real],
    least: float,
    most: float,
    *,
    unit: str = "",
    open_below: bool = False,
) -> Callable[[str], Real]:
    """Make a parser of numbers from `least`, itself left out if `open_below`, to `most`.

    `parse` is `float` or `int`. No limit admits NaN or infinity.
    """
    kind = "an integer" if parse is int else "a number"
    above = "more than" if open_below else "at least"
    wanted = f"{kind} of {above} {least:,} and at most {most:,} {unit}".strip()

    def parse_within(text: str) -> Real:
        try:
            value = parse(text)
        except ValueError:
            value = None
        if value is None or not least <= value <= most or (open_below and value == least):
            raise click.BadParameter(f"{str(text)[:40]!r} is not {wanted}")
        return value

    return parse_within


PATH = PathType()
FILE = PathType(is_file=True)
INPUT = PathType(is_input=True)
DURATION_S = number(float, 0, MOST_S, unit="s", open_below=True)
SEED = number(int, 0, 2**63 - 1)

# eager: known to options that print and end
json_option = click.option("--json", "as_json", is_flag=True, is_eager=True, help="Print JSON.")


version_option = partial(
    click.version_option, package_name="cellwalk", message="%(prog)s %(version)s"
)


class Program(click.Group):
    """A program whose help has its commands under titles; `help --all` lists the others too.

    `sections` are the names of commands under each title, in their order.
    """

    def __init__(
        self, *args: Any, sections: Mapping[str, Sequence[str]], **attributes: Any
    ) -> None:
        super().__init__(*args, **attributes)
        self._sections = sections
        self.add_command(_help)

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of the commands but for those of earlier versions."""
        return [name for name in super().list_commands(ctx) if not self.commands[name].hidden]

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        for title, names in self._sections.items():
            self._write(formatter, title, names)
        if self._others:
            with formatter.section("Others"):
                formatter.write_text(f"{ctx.command_path} help --all lists them")

    def list_all(self, ctx: click.Context) -> str:
        """Every command under a title."""
        formatter = ctx.make_formatter()
        for title, names in {**self._sections, "Others": self._others}.items():
            self._write(formatter, title, names)
        return formatter.getvalue().strip()

    @property
    def _others(self) -> list[str]:
        titled = {name for names in self._sections.values() for name in names} | {_help.name}
        return sorted(n for n, c in self.commands.items() if n not in titled and not c.hidden)

    def _write(self, formatter: click.HelpFormatter, title: str, names: Iterable[str]) -> None:
        width = max(map(len, self.commands))
        rows = [(n.ljust(width), self.commands[n].get_short_help_str(_SHORT_HELP)) for n in names]
        if rows:
            with formatter.section(title):
                formatter.write_dl(rows)


_SHORT_HELP = 62
"""Columns of a command's first sentence: with the longest name a line has 80."""


@click.command("help", hidden=True)
@click.option("--all", "every", is_flag=True, help="List every command.")
@click.argument("names", nargs=-1, metavar="[COMMAND]...")
@click.pass_context
def _help(ctx: click.Context, names: Sequence[str], *, every: bool) -> None:
    """Print the help of a command, or list all."""
    context = ctx.find_root()
    command: click.Command = context.command
    for name in names:
        below = command.get_command(context, name) if isinstance(command, click.Group) else None
        if below is None:
            raise click.UsageError(f"No such command {name!r}.", context)
        command, context = below, click.Context(below, info_name=name, parent=context)
    if every and isinstance(command, Program):
        print(command.list_all(context))
    else:
        print(command.get_help(context))


def say_new_name(old: str, new: str) -> None:
    """Say on stderr that a command has another name."""
    print(f"{old.partition(' ')[0]}: `{old}` is now `{new}`", file=sys.stderr)


def under_old_name(command: click.Command, old: str, new: str) -> click.Command:
    """The same command under an earlier name, not listed, that says the new one."""
    alias = copy.copy(command)
    callback: Callable[..., Any] = command.callback or say_new_name

    @wraps(callback)
    def with_note(*arguments: Any, **options: Any) -> Any:
        say_new_name(old, new)
        return callback(*arguments, **options)

    alias.name, alias.hidden, alias.callback = old.rpartition(" ")[2], True, with_note
    return alias


def show(said: "document.Document", *, as_json: bool) -> None:
    """Print a document as JSON, or as lines, with styles where somebody is looking."""
    for remark in said.remarks:
        print(remark, file=sys.stderr)
    if as_json:
        print(document.json_text(said.content))
        return
    # past the filter of control characters, which is for text that is not a document
    terminal = getattr(sys.stdout, "rich_proxied_file", sys.stdout)
    columns = shutil.get_terminal_size().columns if terminal.isatty() else None
    is_styled = _shows_styles(terminal)
    for line in document.terminal_lines(said, columns, is_styled=is_styled):
        print(line, file=terminal, flush=True)


def _shows_styles(terminal: TextIO) -> bool:
    """On terminals only, and not for those who say so (no-color.org)."""
    is_plain = bool(os.environ.get("NO_COLOR")) or os.environ.get("TERM") == "dumb"
    return terminal.isatty() and not is_plain


def run_program(program: click.Group, name: str, argv: Sequence[str] | None) -> int:
    """Run one command line (default: this process's) and return its exit code."""
    with plain_streams():
        try:
            return _invoke(program, name, sys.argv[1:] if argv is None else argv)
        except click.exceptions.Exit as end:  # --help, --version
            return end.exit_code
        except BrokenPipeError:
            return 0
        except KeyboardInterrupt:
            return INTERRUPTED
        except (click.ClickException, FieldLoggerError, ModuleNotFoundError, OSError) as error:
            print(f"{name}: {printable(_reason(error))}", file=sys.stderr)
            return 2


def _invoke(program: click.Group, name: str, argv: Sequence[str]) -> int:
    completion = f"_{name.upper()}_COMPLETE"
    if completion in os.environ:
        return shell_complete(program, {}, name, completion, os.environ[completion])
    with program.make_context(name, list(argv)) as context:
        code: int | None = program.invoke(context)
        return code or 0


def _reason(error: Exception) -> str:
    if isinstance(error, click.UsageError) and error.ctx is not None:
        # click lists the choices of an argument on lines of their own
        text = " ".join(error.format_message().split()).rstrip(".")
        return f"{text}; see '{error.ctx.command_path} --help'"
    if isinstance(error, ModuleNotFoundError):
        if error.name is None or error.name.startswith(("logger", "postproc")):
            raise error
        return missing_library(error.name)
    if isinstance(error, OSError):
        name = error.filename2 or error.filename or ""  # of a copy what it is written to
        return f"{name}: {error.strerror or error}".removeprefix(": ")
    return str(error)


def missing_library(module: str, extra: str = "") -> str:
    """The extra that brings a library, or Debian's package for the program of Debian."""
    library = module.partition(".")[0]
    if library in sys.stdlib_module_names:
        return f"{library} is missing: this Python was built without it"
    if Path(__file__).is_relative_to(_DEBIAN_FOLDER):
        package = _DEBIAN_NAMES.get(library, library)
        return f"{library} is missing: sudo apt-get install python3-{package}"
    # of this Python, which knows our version: another would install a stranger's cellwalk
    pip = f"{shlex.quote(sys.executable)} -m pip install"
    return f"{library} is missing: {pip} 'cellwalk{extra or _EXTRAS.get(library, '[post]')}'"


_EXTRAS = (
    dict.fromkeys(("click", "h5py", "msgspec", "numpy", "pynmea2", "pyproj", "serial"), "")
    | dict.fromkeys(("segno", "tornado"), "[page]")
    | dict.fromkeys(("pyarrow", "rerun", "rerun_cli"), "[view]")
    | dict.fromkeys(("cryptography", "dask", "distributed", "geopandas", "pandas"), "[survey]")
)
"""Extra of each library that is imported, where it is not that of the desktop program."""
_DEBIAN_FOLDER = "/usr/lib/fieldlogger"
_DEBIAN_NAMES = {"pynmea2": "nmea2"}


@click.command
@click.argument("path", type=PATH)
@json_option
@click.pass_context
def recover(context: click.Context, path: Path, *, as_json: bool) -> int:
    """Make HDF5 files of journals that a power cut left behind.

    PATH is a journal or a folder of runs. The exit code is 3 if anything was lost.
    """
    results: list[runfile.Recovered] = []

    def lines() -> Iterator[str]:
        for result in runfile.recover(path):
            results.append(result)
            yield str(result)

    body = list(lines()) if as_json else lines()  # as they come
    content = [result.as_dict() for result in results]
    show(document.Document(content, body=body), as_json=as_json)
    if not results and not as_json:
        print(f"{path}: no journal there lacks its HDF5 file", file=sys.stderr)
    losses = [result.loss for result in results if result.loss]
    for loss in losses if not as_json else ():
        print(f"{context.find_root().info_name}: {loss}", file=sys.stderr)
    return SOMETHING_LOST if losses else 0
