"""All names that the documentation may use: those of the source, its files and its options."""

import ast
import re
import tomllib
from functools import cache
from pathlib import Path

from tests.docs.pages import ROOT

SOURCES = ("logger", "postproc", "benchmarks", "tests/kit", "tests/drivers", "tests/device")
ANYTHING_BUT_TEXT = re.compile(r"[\w.^+#*!=/:<>-]+(?: [\w.^+#*!=/:<>-]+){0,2}")
"""Strings of the source that are names: at most three words."""

TERMS = {
    ".h5": "suffix of an HDF5 run",
    ".gz": "suffix of a compressed file",
    ".zip": "suffix of a compressed file",
    ".journal.2": "suffix of the continuation of a journal",
    ".3": "suffix of the second continuation of a journal",
    ".venv": "folder of the virtual environment",
    "_dbm _m _deg _ns": "units as the ends of names",
    "<family>": "placeholder of CONTRIBUTING",
    "run.html": "name of a report in an example",
    "262-01-4711-100": "name of a cell in an example",
    "LTE-5780-210": "name of a cell in an example",
    "GSM-62-37": "name of a cell in an example",
    "WCDMA-10737-25": "name of a cell in an example",
    "NR-632448-17": "name of a cell in an example",
    "pi": "name of a user in an example",
    "pipx ensurepath": "command of pipx",
    "sudo": "command of Unix",
    "du -sm": "command of Unix",
    "/sys/class/power_supply": "folder of Linux",
    "/sys/class/hwmon": "folder of Linux",
    "null": "JSON",
    "number": "field of a journal frame",
    "run": "field of a journal frame",
    "h5dump": "program of HDF5",
    "h5dump -a /readings/columns run-000017.h5": "command of HDF5",
    "rerun": "program of the viewer",
    "ATI": "AT command of every modem",
    "AT+CGMI": "AT command of every modem",
    "AT+CGMM": "AT command of every modem",
    "[x, y, P0, eta]": "state vector in the notation of the specification",
    "/run/cellwalk/status.json": "file of a running service, see systemd/fieldlogger.service",
    "/etc/cellwalk/site.toml": "configuration of the service, see systemd/debian/postinst",
    "systemctl status fieldlogger": "command of systemd",
    "run-000017.journal.2": "continuation of a journal in an example",
    "run-000017.journal": "name of a run in an example",
    "run-000017.h5": "name of a run in an example",
    "run-000017.post.h5": "name of a result in an example",
    "cells/0/ekf/x": "array in a result, see postproc.results.write",
    'pandas.read_hdf("run-000017.h5", "fixes")': "pandas; tests/core/runfile/test_page.py runs it",
}
"""What is named in the text and is not part of the source, with the reason."""


@cache
def source_names() -> frozenset[str]:
    """Names defined in the source, strings that are names, and dotted paths of modules."""
    names: set[str] = set()
    for folder in SOURCES:
        for path in (ROOT / folder).rglob("*.py"):
            module = path.relative_to(ROOT).with_suffix("").as_posix().replace("/", ".")
            module = module.removesuffix(".__init__")
            tree = ast.parse(path.read_text("utf-8"))
            names.update(_module_paths(module))
            for node in ast.walk(tree):
                names.update(_names_of(node))
            for name in _top_level(tree):
                names.update(f"{path}.{name}" for path in _module_paths(module))
    return frozenset(names)


def _module_paths(module: str) -> set[str]:
    """A module may be named with or without its package: `logger.core.ekf`, `core.ekf`, `ekf`."""
    parts = module.split(".")
    return {".".join(parts[i:]) for i in range(len(parts))}


def _names_of(node: ast.AST) -> list[str]:
    match node:
        case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
            return [name]
        case ast.Name(id=name, ctx=ast.Store()) | ast.arg(arg=name) | ast.alias(name=name):
            return [name]
        case ast.Attribute(attr=name, ctx=ast.Store()):
            return [name]
        case ast.Constant(value=str(text)) if ANYTHING_BUT_TEXT.fullmatch(text):
            return [text]
    return []


def _top_level(tree: ast.Module) -> list[str]:
    names = [name for node in tree.body for name in _names_of(node)]
    for node in tree.body:
        if isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            names += [target.id for target in targets if isinstance(target, ast.Name)]
        if isinstance(node, ast.ClassDef):
            names += [f"{node.name}.{n}" for part in node.body for n in _names_of(part)]
        if isinstance(node, ast.ImportFrom):
            names += [alias.asname or alias.name for alias in node.names]
    return names


@cache
def make_targets() -> frozenset[str]:
    """Targets of the Makefile."""
    text = (ROOT / "Makefile").read_text("utf-8")
    return frozenset(re.findall(r"^([a-z-]+):", text, re.MULTILINE))


@cache
def extras() -> frozenset[str]:
    """Optional sets of dependencies."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    return frozenset(project["optional-dependencies"])


@cache
def configuration_keys() -> frozenset[str]:
    """Keys and sections of systemd/site.toml, those in comments as well."""
    text = (ROOT / "systemd/site.toml").read_text("utf-8")
    return frozenset(re.findall(r"^(?:# )?(\[\w+\]|\w+)(?: = |$)", text, re.MULTILINE))


def file_exists(text: str, page: Path) -> bool:
    """True for a file or folder of the repository; `<family>` stands for any."""
    pattern = re.sub(r"<\w+>", "*", text.rstrip("/"))
    if not re.fullmatch(r"[\w.*{},/-]+", pattern) or not re.search(r"[a-z]", pattern):
        return False
    folders = (ROOT, page.parent, ROOT / "logger", ROOT / "postproc", ROOT / "logger/core")
    named = (path for part in _alternatives(pattern) for at in folders for path in at.glob(part))
    return any(map(_has_files, named))


def _has_files(path: Path) -> bool:
    # a folder that was renamed leaves its compiled modules behind, which no checkout has
    names = (path,) if path.is_file() else path.rglob("*")
    return any(name.is_file() and name.suffix != ".pyc" for name in names)


def _alternatives(pattern: str) -> list[str]:
    match = re.search(r"{([^}]*)}", pattern)
    if match is None:
        return [pattern.lstrip("/")]
    return [pattern.replace(match[0], part).lstrip("/") for part in match[1].split(",")]
