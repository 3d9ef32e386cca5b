"""What install.sh says to a mistake; that it installs, and that a real boot then records, is tested
in tests/boot.
"""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).parents[2]
INSTALL = REPOSITORY / "systemd/install.sh"


def _install(*options):
    return subprocess.run(
        ["sh", INSTALL, *map(str, options)], capture_output=True, text=True, check=False
    )


@pytest.mark.parametrize(
    ("options", "code", "says"),
    [
        (["/nowhere"], 1, "no such file or folder: /nowhere"),
        (["--wings"], 2, "--uninstall"),
        (["--help"], 0, "make card-debs"),
    ],
)
def test_a_mistake_is_told(options, code, says):
    done = _install(*options)
    assert done.returncode == code
    assert says in done.stdout + done.stderr


def test_a_folder_that_make_did_not_fill_is_refused_before_anything_is_done(tmp_path):
    done = _install(tmp_path)
    assert done.returncode == 1
    expected = "make card-debs" if os.getuid() == 0 else "as root"
    if shutil.which("apt-get") is None and os.getuid() == 0:
        expected = "no apt-get"
    assert expected in done.stderr


@pytest.mark.skipif(shutil.which("shellcheck") is None, reason="no shellcheck here")
def test_shellcheck_finds_nothing():
    done = subprocess.run(["shellcheck", INSTALL], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
