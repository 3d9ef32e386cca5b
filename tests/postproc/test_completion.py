"""The completion in the shell that it is for."""

import re
import shlex
import shutil
import subprocess
import sys

import pytest

from postproc.cli import main
from tests.kit.terminal import on_terminal

BASH = shutil.which("bash")


def completed(folder, script, typed):
    """What bash makes of a line whose last word is begun and followed by a tab."""
    ready = f"cd {shlex.quote(str(folder))}; source {script}; bind 'set enable-bracketed-paste off'"
    told = "postproc() { printf 'told'; printf '<%s>' \"$@\"; echo; }"
    shown, _ = on_terminal(
        BASH, "--norc", "--noprofile", "-i", typed=f"{ready}\n{told}\npostproc {typed}\t\nexit\n"
    )
    (line,) = [line.strip() for line in shown.splitlines() if line.strip().startswith("told<")]
    return line.removeprefix("told")


@pytest.fixture(scope="module")
def script(tmp_path_factory):
    path = tmp_path_factory.mktemp("completion") / "postproc.bash"
    made = subprocess.run(
        [sys.executable, "-m", "postproc.cli", "completion", "bash"],
        capture_output=True,
        check=True,
        text=True,
    )
    path.write_text(made.stdout)
    return path


@pytest.mark.skipif(BASH is None, reason="bash is missing")
@pytest.mark.parametrize(
    ("typed", "expected"),
    [
        ("smo", "<smooth>"),
        ("report --pic", "<report><--pictures>"),
        ("smooth --loss hub", "<smooth><--loss><huber>"),
        ("smooth wal", "<smooth><walk.h5>"),
        ("celldb loo", "<celldb><lookup>"),
        ("completion f", "<completion><fish>"),
    ],
)
def test_bash_completes_commands_options_choices_and_files(script, tmp_path, typed, expected):
    (tmp_path / "walk.h5").touch()
    assert completed(tmp_path, script, typed) == expected


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish", "tcsh"])
def test_every_shell_gets_a_script_that_knows_the_commands(shell, capsys):
    assert main(["completion", shell]) == 0
    assert {"smooth", "report", "celldb"} <= set(re.findall(r"[a-z]+", capsys.readouterr().out))
