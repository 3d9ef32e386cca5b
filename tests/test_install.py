"""The plain install is the logger: light, and whole."""

import json
import subprocess
import sys
import tomllib
import venv
from pathlib import Path

import pytest

HEAVY = {"scipy", "rerun-sdk", "pyarrow", "matplotlib", "pandas", "rich", "shapely"}


@pytest.fixture(scope="module")
def clean(tmp_path_factory, request):
    """A fresh environment with `pip install cellwalk`, from this checkout."""
    folder = tmp_path_factory.mktemp("clean")
    venv.create(folder, with_pip=True)
    source = request.config.rootpath
    subprocess.run(
        [folder / "bin/pip", "install", "--quiet", "--disable-pip-version-check", source],
        check=True,
    )
    return folder


def test_plain_install_pulls_nothing_heavy(clean):
    listed = subprocess.run(
        [clean / "bin/pip", "list", "--format", "json", "--disable-pip-version-check"],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    names = {package["name"].lower() for package in json.loads(listed.stdout)}
    assert not names & HEAVY
    assert "cellwalk" in names


def test_plain_install_checks_itself(clean, pytestconfig):
    process = subprocess.run(
        [clean / "bin/fieldlogger", "check"], capture_output=True, text=True, check=False
    )
    assert process.returncode == 0, process.stderr
    assert "h5py" in process.stdout


def test_desk_without_its_libraries_says_what_to_install(clean, tmp_path):
    (tmp_path / "run.h5").write_text("x")
    process = subprocess.run(
        [clean / "bin/postproc", "smooth", tmp_path / "run.h5"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert process.returncode == 2
    assert "cellwalk[post]" in process.stderr
    assert len(process.stderr.splitlines()) == 1


def test_versions_asked_for_are_those_of_debian_12():
    wanted = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())["project"]
    assert wanted["requires-python"] == ">=3.11"
    assert {"numpy>=1.24", "h5py>=3.7", "pyproj>=3.4", "pyserial>=3.5", "pynmea2>=1.15"} <= set(
        wanted["dependencies"]
    )
    assert any(
        line.startswith("rerun-sdk~=0.41.0") for line in wanted["optional-dependencies"]["view"]
    )
    assert sys.version_info >= (3, 11)
