"""Write the manual pages and the shell completion of fieldlogger, from the commands themselves.

Arguments: the folder `usr/share` of the package, and the version. Needs click and click-man only.
"""

import datetime as dt
import os
import sys
from pathlib import Path

import click
from click.shell_completion import get_completion_class
from click_man.core import write_man_pages

NAME = "fieldlogger"
REPOSITORY = Path(__file__).parents[2]
COMPLETION = {
    "bash": "bash-completion/completions/fieldlogger",
    "zsh": "zsh/vendor-completions/_fieldlogger",
    "fish": "fish/vendor_completions.d/fieldlogger.fish",
}
WHOLE_SENTENCE = 500
"""Characters; click shortens the descriptions in lists to 45."""


def main(share: Path, version: str) -> None:
    sys.path.insert(0, str(REPOSITORY))
    from logger.cli import program  # noqa: PLC0415 (found by the line above)

    for command in program.commands.values():
        command.short_help = command.get_short_help_str(WHOLE_SENTENCE)
    built = dt.datetime.fromtimestamp(int(os.environ["SOURCE_DATE_EPOCH"]), dt.UTC)
    write_man_pages(
        NAME, program, version=version, target_dir=share / "man/man1", date=f"{built:%Y-%m-%d}"
    )
    for page in (share / "man/man1").iterdir():
        # click's sign that lines are not to be joined, which roff does not know
        page.write_text(page.read_text("utf-8").replace("\b\n", ""), "utf-8")
    for shell, path in COMPLETION.items():
        (share / path).parent.mkdir(parents=True, exist_ok=True)
        (share / path).write_text(_completion(program, shell), encoding="utf-8")


def _completion(program: click.Group, shell: str) -> str:
    """The script that asks fieldlogger itself what may follow, whenever TAB is pressed."""
    complete = get_completion_class(shell)
    assert complete is not None
    return complete(program, {}, NAME, f"_{NAME.upper()}_COMPLETE").source()


main(Path(sys.argv[1]), sys.argv[2])
