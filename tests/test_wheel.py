"""The wheel and the source distribution that an index would take, and what they install."""

import email
import subprocess
import sys
import tarfile
import venv
import zipfile
from pathlib import Path

import pytest

from logger.core.runfile import finish_journal
from tests.docs.pages import ROOT
from tests.kit.sample_results import write_run

pytestmark = pytest.mark.slow

MOST_WHEEL_BYTES = 2_000_000
MOST_MIB = {"desk": 420, "post": 620}
"""Of an environment without pip, with byte code; docs/guide/desktop.md has what was measured."""


def run(*command: object) -> str:
    """Output of a command that has to succeed."""
    words = [str(word) for word in command]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def distribution_files(tmp_path_factory):
    """Wheel and source distribution; the wheel is built from the latter."""
    pytest.importorskip("build", reason="pip install '.[dev]'")
    folder = tmp_path_factory.mktemp("dist")
    run(sys.executable, "-m", "build", "--outdir", folder)
    (wheel,), (source,) = folder.glob("*.whl"), folder.glob("*.tar.gz")
    return wheel, source


def test_an_index_takes_both(distribution_files):
    pytest.importorskip("twine", reason="pip install '.[dev]'")
    run(sys.executable, "-m", "twine", "check", "--strict", *distribution_files)


def test_the_wheel_is_small_and_has_every_licence(distribution_files):
    wheel, _ = distribution_files
    assert wheel.stat().st_size <= MOST_WHEEL_BYTES
    with zipfile.ZipFile(wheel) as content:
        names = content.namelist()
        (metadata,) = (name for name in names if name.endswith(".dist-info/METADATA"))
        fields = email.message_from_bytes(content.read(metadata))
    licences = fields.get_all("License-File")
    packed = [name for name in names if "licence" in Path(name).name and "dist-info" not in name]
    assert {"LICENSE", "logger/core/suspicion/data/README.md", *packed} == set(licences)
    assert any("maplibre" in name for name in packed) == any(n.endswith("gl.mjs") for n in names)
    assert not [name for name in names if name.startswith("tests/")]


def test_the_source_distribution_has_what_its_tests_need(distribution_files):
    with tarfile.open(distribution_files[1]) as content:
        names = {name.partition("/")[2] for name in content.getnames()}
    assert {"tests/test_wheel.py", "docs/guide.md", "Makefile", "systemd/site.toml"} <= names
    assert not [name for name in names if name.startswith((".venv", "dist", "demo-out"))]


@pytest.mark.parametrize("extra", MOST_MIB)
def test_it_works_in_an_empty_environment(distribution_files, extra, tmp_path):
    environment = tmp_path / "environment"
    venv.create(environment, with_pip=True)
    programs = environment / "bin"
    run(
        programs / "pip",
        "install",
        "-q",
        "--disable-pip-version-check",
        f"{distribution_files[0]}[{extra}]",
    )
    run(programs / "pip", "check")
    run(programs / "pip", "uninstall", "-q", "-y", "setuptools", "pip")
    assert _mebibytes(environment) <= MOST_MIB[extra]
    assert "smooth" in run(programs / "postproc", "--help")
    journal = tmp_path / "run-000017.journal"
    write_run(journal, seconds=240, cells=1)
    walk = finish_journal(journal)
    assert "262-01-4711-100" in run(programs / "postproc", "smooth", walk)
    run(programs / "postproc", "report", walk, "-o", tmp_path / "walk.html")
    assert (tmp_path / "walk.html").stat().st_size > 10_000


def _mebibytes(folder: Path) -> int:
    return int(run("du", "-sm", folder).split()[0])
