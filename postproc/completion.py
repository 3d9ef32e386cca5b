"""Shell completion, generated from the parser."""

import argparse
from collections.abc import Iterator
from pathlib import Path

import shtab

from logger.core.arguments import file_path, input_path, path


def script(parser: argparse.ArgumentParser, shell: str) -> str:
    """Completion of a command for `bash`, `zsh`, `fish` or `tcsh`; what takes a path is completed
    to files.
    """
    for action in _actions(parser):
        if action.type in {Path, path, file_path, input_path}:
            action.complete = shtab.FILE  # type: ignore[attr-defined]
    return str(shtab.complete(parser, shell))


def _actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """Arguments of a command and of all commands below it."""
    for action in parser._actions:  # noqa: SLF001 (argparse has no other way)
        yield action
        if isinstance(action, argparse._SubParsersAction):  # noqa: SLF001
            for command in action.choices.values():
                yield from _actions(command)
