"""What both programs share: their version, and what they say where a library is missing."""

import ast
import os
import re
import shutil
import subprocess
import sys
from functools import cache
from importlib import import_module, metadata

import click
import pytest
from packaging.requirements import Requirement

from logger import command_line
from logger.cli import main as fieldlogger
from postproc.cli import main as postproc
from tests.docs.pages import ROOT
from tests.kit.faulty_card import small_file_system

CLAIM = 'listen = "127.0.0.1:8080"'


@pytest.mark.parametrize(("name", "main"), [("fieldlogger", fieldlogger), ("postproc", postproc)])
def test_the_version_is_that_of_the_package(name, main, capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"{name} {metadata.version('cellwalk')}\n"


@pytest.mark.parametrize(("redirect", "shown"), [("", b"walk?.h5 (hdf5)"), (">&-", b"")])
def test_any_output_is_one(redirect, shown, tmp_path):
    log = tmp_path / "log.csv"
    log.write_text("t_s,lat,lon,rssi_dbm\n0,52,13,-70\n1,52,13,-70\n")
    run = tmp_path / "walk–.h5"
    assert postproc(["import", str(log), "-o", str(run)]) == 0
    command = [sys.executable, "-m", "postproc.cli", "info", str(run)]
    done = subprocess.run(
        ["sh", "-c", f'"$@" {redirect}', "sh", *command],
        env=os.environ | {"PYTHONIOENCODING": "ascii"},
        capture_output=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, b"")
    assert shown in done.stdout


@cache
def _imported_libraries() -> frozenset[str]:
    """Names of all foreign packages that a module of ours imports."""
    names = set()
    for folder in ("logger", "postproc"):
        for path in (ROOT / folder).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text("utf-8"))):
                match node:
                    case ast.Import(names=aliases):
                        names.update(alias.name.partition(".")[0] for alias in aliases)
                    case ast.ImportFrom(module=str(module), level=0):
                        names.add(module.partition(".")[0])
    return frozenset(names - sys.stdlib_module_names - {"logger", "postproc"})


@cache
def _distributions_of(extra: str) -> frozenset[str]:
    """Distributions that `pip install cellwalk[extra]` brings."""
    found, waiting = set(), [Requirement(f"cellwalk[{extra}]" if extra else "cellwalk")]
    while waiting:
        wanted = waiting.pop()
        name = re.sub(r"[-_.]+", "-", wanted.name).lower()
        if (name, *wanted.extras) in found:
            continue
        found |= {(name, *wanted.extras), (name,)}
        for line in metadata.requires(name) or ():
            needed = Requirement(line)
            sets = wanted.extras or {""}
            if needed.marker is None or any(needed.marker.evaluate({"extra": e}) for e in sets):
                waiting.append(needed)
    return frozenset(name for (name, *_) in found)


def _message_without(library: str, monkeypatch, capsys) -> str:
    @click.group
    def program() -> None: ...

    @program.command
    def use() -> None:
        import_module(library)

    monkeypatch.setitem(sys.modules, library, None)  # as if it were not installed
    assert command_line.run_program(program, "program", ["use"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    return line


PIP = f"{sys.executable} -m pip install"


@pytest.mark.parametrize("library", sorted(_imported_libraries()))
def test_a_missing_library_is_in_the_extra_that_is_named(library, monkeypatch, capsys):
    line = _message_without(library, monkeypatch, capsys)
    named = re.fullmatch(rf"program: {library} is missing: {PIP} 'cellwalk(?:\[(\w+)\])?'", line)
    assert named, line
    distributions = metadata.packages_distributions().get(library)
    if distributions is None:
        pytest.skip(f"no {library} here")
    assert {name.lower() for name in distributions} & _distributions_of(named[1] or ""), line


@pytest.mark.parametrize("library", sorted(_imported_libraries() & set(command_line._EXTRAS)))
def test_the_debian_package_is_named_where_the_program_is_of_one(library, monkeypatch, capsys):
    monkeypatch.setattr(command_line, "_DEBIAN_FOLDER", str(ROOT))
    line = _message_without(library, monkeypatch, capsys)
    package = re.fullmatch(rf"program: {library} is missing: sudo apt-get install (\S+)", line)[1]
    control = (ROOT / "systemd/debian/control").read_text("utf-8")
    needed = re.findall(r"python3-[\w-]+", control)
    if command_line._EXTRAS[library] in {"", "[page]"} and library != "msgspec":  # that is inside
        assert package in needed


def test_what_python_was_built_without_is_in_no_package(monkeypatch, capsys):
    line = _message_without("_sqlite3", monkeypatch, capsys)
    assert line == "program: _sqlite3 is missing: this Python was built without it"


@pytest.mark.parametrize(("library", "option"), [("tornado", []), ("segno", ["--show"])])
def test_the_page_names_its_extra(library, option, tmp_path, monkeypatch):
    site = tmp_path / "site.toml"
    text = (ROOT / "systemd/site.toml").read_text("utf-8").replace('# listen = ""', CLAIM)
    site.write_text(text, "utf-8")
    monkeypatch.setenv("STATE_DIRECTORY", str(tmp_path))
    (tmp_path / "token").write_text("0" * 64)
    without = f"import sys; sys.modules[{library!r}] = None; from logger.cli import main"

    def error_of(*arguments):
        done = subprocess.run(
            [sys.executable, "-c", f"{without}; sys.exit(main())", *arguments, "--config", site],
            check=False,
            capture_output=True,
            text=True,
        )
        assert done.returncode == 2
        return done.stdout + done.stderr

    missing = f"{library} is missing: {PIP} 'cellwalk[page]'"
    assert error_of("page", *option).strip().endswith(missing)
    assert f"page: {missing}" in error_of("check")


LATE = """
import sys
from logger.command_line import late_modules
with late_modules():
    from logger.core import places
assert "pyproj" not in sys.modules
places.Utm
assert "pyproj" in sys.modules
from logger.core import ekf  # outside: as ever
assert type(ekf) is type(sys)
"""


def test_a_late_module_runs_at_its_first_use():
    subprocess.run([sys.executable, "-c", LATE], check=True)


WITHOUT = """
import sys
from logger.command_line import late_modules
sys.modules["pyproj"] = None
with late_modules():
    from logger.core import places
for _ in range(2):
    try:
        from logger.core.places import Utm
    except ModuleNotFoundError as error:
        assert error.name == "pyproj"
    else:
        raise AssertionError
"""


def test_a_late_module_tells_at_each_use_which_library_is_missing():
    subprocess.run([sys.executable, "-c", WITHOUT], check=True)


INTERRUPTED = """
import sys
from logger.command_line import late_modules

class Interrupt:
    def find_spec(self, name, *_):
        if name == "pyproj":
            raise KeyboardInterrupt

with late_modules():
    from logger.core import places
sys.meta_path.insert(0, Interrupt())
for is_there in (True, False):
    try:
        if is_there:
            from logger.core.places import hypot  # imported before the interrupt
        else:
            from logger.core.places import Utm
    except KeyboardInterrupt:
        pass
    else:
        raise AssertionError
"""


def test_an_interrupt_while_a_late_module_runs_is_no_missing_name():
    subprocess.run([sys.executable, "-c", INTERRUPTED], check=True)


def test_help_of_a_command_is_that_of_its_option(capsys):
    assert postproc(["help", "survey", "add"]) == 0
    by_name = capsys.readouterr().out
    assert postproc(["survey", "add", "--help"]) == 0
    assert by_name == capsys.readouterr().out
    assert postproc(["help", "survey", "none"]) == 2
    assert "No such command 'none'" in capsys.readouterr().err


def test_a_copy_names_the_file_that_has_no_room(tmp_path, capsys):
    source = tmp_path / "source"
    source.write_bytes(bytes(1 << 20))

    @click.group
    def program():
        pass

    with small_file_system(tmp_path / "disk", "size=64k") as disk:
        copy = click.Command("copy", callback=lambda: shutil.copy(source, disk / "target"))
        program.add_command(copy)
        assert command_line.run_program(program, "postproc", ["copy"]) == 2
    said = f"postproc: {disk / 'target'}: No space left on device\n"
    assert capsys.readouterr().err == said
