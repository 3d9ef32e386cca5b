"""install.sh into a folder instead of a machine; that a real boot then records is tested in
tests/boot.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).parents[2]
INSTALL = REPOSITORY / "systemd/install.sh"


def _install(*options):
    return subprocess.run(
        ["sh", INSTALL, *map(str, options)], capture_output=True, text=True, check=False
    )


def _files(root):
    return {
        str(path.relative_to(root)): path.read_bytes() if path.is_file() else None
        for path in root.rglob("*")
        if "/opt/" not in str(path) and not path.is_symlink()
    }


@pytest.fixture(scope="module")
def wheels(tmp_path_factory):
    """The program and all it needs, as `make wheels` and Debian's packages give it together."""
    folder = tmp_path_factory.mktemp("wheels")
    pip = [
        sys.executable,
        "-m",
        "pip",
        "wheel",
        "--quiet",
        "--disable-pip-version-check",
        "-w",
        folder,
    ]
    subprocess.run([*pip, REPOSITORY], check=True)
    return folder


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("systemd-sysusers") is None, reason="no systemd here")
def test_it_installs_again_and_again_without_a_network_and_goes_again(wheels, tmp_path):
    root = tmp_path / "root"
    root.mkdir()
    options = ("--root", root, "--wheels", wheels, "--prefix", "/opt/walk")
    done = _install(*options)
    assert done.returncode == 0, done.stderr
    process = subprocess.run(
        [root / "opt/walk/bin/fieldlogger", "check"], capture_output=True, text=True, check=False
    )
    assert process.returncode == 0, process.stdout
    assert (
        "ExecStart=/opt/walk/bin/fieldlogger run"
        in (root / "etc/systemd/system/fieldlogger.service").read_text()
    )
    assert os.readlink(root / "usr/local/bin/fieldlogger") == "/opt/walk/bin/fieldlogger"
    assert (root / "etc/systemd/system/multi-user.target.wants/fieldlogger.service").is_symlink()
    assert "cellwalk:" in (root / "etc/passwd").read_text()

    (root / "etc/cellwalk/site.toml").write_text("# mine")
    before = _files(root)
    assert _install(*options).returncode == 0
    assert _files(root) == before

    assert _install("--root", root, "--prefix", "/opt/walk", "--uninstall").returncode == 0
    assert (root / "etc/cellwalk/site.toml").read_text() == "# mine"
    assert not (root / "opt/walk").exists()
    left = [
        path for path in root.rglob("*") if "fieldlogger" in path.name or "cellwalk." in path.name
    ]
    assert left == []


def test_uninstalling_what_is_not_there_takes_nothing_else_away(tmp_path):
    mine = tmp_path / "opt/mine"
    mine.mkdir(parents=True)
    (mine / "precious").write_text("x")
    assert _install("--root", tmp_path, "--prefix", "/opt/mine", "--uninstall").returncode == 0
    assert (mine / "precious").read_text() == "x"


@pytest.mark.parametrize(
    ("options", "code", "says"),
    [
        (["--wheels"], 1, "needs a folder"),
        (["--wheels", "/nowhere", "--root", "/nowhere"], 1, "no such folder"),
        (["--wings"], 2, "--uninstall"),
        (["--help"], 0, "--wheels DIR"),
    ],
)
def test_a_mistake_is_told(options, code, says):
    done = _install(*options)
    assert done.returncode == code
    assert says in done.stdout + done.stderr


@pytest.mark.skipif(shutil.which("shellcheck") is None, reason="no shellcheck here")
def test_shellcheck_finds_nothing():
    done = subprocess.run(["shellcheck", INSTALL], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
