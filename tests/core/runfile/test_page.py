"""docs/runfile.md agrees with the schema and with what other programs read in the HDF5 file."""

import shutil
import subprocess
import sys
from pathlib import Path

import h5py
import pytest

from logger.core.document import markdown_text
from logger.core.runfile import convert_journal
from logger.core.runfile.hdf5 import RAW_BYTES
from logger.core.schema import SCHEMA_VERSION, TABLES, tables_text
from tests.kit import runs

PAGE = (Path(__file__).parents[3] / "docs/runfile.md").read_text()


def test_every_column_is_described():
    text = tables_text()
    assert f"Schema {SCHEMA_VERSION}." in text
    for table, columns in TABLES.items():
        _, _, section = text.partition(f"## {table}\n")
        for column in columns:
            assert markdown_text(column.name) in section
            assert (
                f"| {markdown_text(str(column.dtype))} | {markdown_text(column.unit)} |" in section
            )


@pytest.fixture
def run(tmp_path):
    runs.write_journal(
        tmp_path / "a.journal", runs.records(20), config_text="[run]\n", versions={"numpy": "2"}
    )
    convert_journal(tmp_path / "a.journal", tmp_path / "a.h5")
    return tmp_path / "a.h5"


def test_the_page_names_every_dataset_and_attribute(run):
    with h5py.File(run) as file:
        assert set(file) == {*TABLES, RAW_BYTES, "meta", "config", "end", "damage", "frames"}
        for name in (*file, *file.attrs):
            assert f"`{name}`" in PAGE
        assert file.attrs["started_utc"].startswith("2026-09-21T14:13:")
        assert file["config"][()] == b"[run]\n"


def _other_python():
    """A Python with pandas and PyTables, which are no dependency of ours."""
    import os

    python = os.environ.get("CELLWALK_PANDAS_PYTHON", sys.executable)
    found = subprocess.run(
        [python, "-c", "import pandas, tables"], capture_output=True, check=False
    )
    if found.returncode:
        pytest.skip("set CELLWALK_PANDAS_PYTHON to a Python that has pandas and tables")
    return python


def test_pandas_and_pytables_open_it(run):
    text = f"""
import warnings; warnings.simplefilter("error")
import pandas, tables
fixes = pandas.read_hdf({str(run)!r}, "fixes")
assert len(fixes) == 20 and abs(fixes.lat_deg[3] - 52.0) < 1e-9
with tables.open_file({str(run)!r}) as file:
    for node in file.walk_nodes("/", "Leaf"):
        node.read()
    assert len(file.root.readings) == 40
"""
    subprocess.run([_other_python(), "-c", text], check=True)


def test_h5dump_opens_it(run):
    if shutil.which("h5dump") is None:
        pytest.skip("h5dump is not installed")
    process = subprocess.run(
        ["h5dump", "-d", "fixes", run], capture_output=True, text=True, check=True
    ).stdout
    assert "lat_deg" in process
