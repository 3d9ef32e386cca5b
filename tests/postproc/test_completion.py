"""Shell completion, in a real bash and by the protocol of the other shells."""

import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from postproc.cli import main
from tests.kit.terminal import on_terminal

BASH = shutil.which("bash")


def completions(folder, script, typed):
    """The arguments of a line that bash completes at a tab after its last word."""
    program = shlex.quote(str(Path(sys.executable).parent))
    setup = (
        f"cd {shlex.quote(str(folder))}; PATH={program}:$PATH; source {script}\n"
        "bind 'set enable-bracketed-paste off'\n"
        "postproc() { printf 'arguments'; printf '<%s>' \"$@\"; echo; }"
    )
    shown, _ = on_terminal(
        BASH, "--norc", "--noprofile", "-i", typed=f"{setup}\npostproc {typed}\t\nexit\n"
    )
    lines = [line.strip() for line in shown.splitlines()]
    (line,) = [line for line in lines if line.startswith("arguments<")]
    return line.removeprefix("arguments")


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
    assert completions(tmp_path, script, typed) == expected


@pytest.mark.parametrize(("shell", "word"), [("bash", "1"), ("zsh", "1"), ("fish", "smo")])
def test_the_script_of_every_shell_asks_the_program(shell, word, capsys, monkeypatch):
    assert main(["completion", shell]) == 0
    assert f"_POSTPROC_COMPLETE={shell}_complete" in capsys.readouterr().out
    monkeypatch.setenv("_POSTPROC_COMPLETE", f"{shell}_complete")
    monkeypatch.setenv("COMP_WORDS", "postproc smo")
    monkeypatch.setenv("COMP_CWORD", word)
    assert main([]) == 0
    assert "smooth" in capsys.readouterr().out
