"""The table of formats, in the source and in the documentation; real samples if there are any."""

import os
import re
from pathlib import Path

import pytest

from postproc.interop.formats import FORMATS, recognise
from postproc.interop.sighting import BadRow, Sighting

ROOT = Path(__file__).parents[3]
SAMPLES = Path(os.environ.get("CELLWALK_FORMATS", ROOT.parent / "shared/corpus/formats"))


def _table():
    return (ROOT / "docs/guide/formats.md").read_text().partition("\n## ")[0]


def test_the_page_lists_every_format_and_no_other():
    names = re.findall(r"^\| ([^|]+?) +\|", _table(), re.MULTILINE)
    assert set(names) - {"format"} == {form.name for form in FORMATS}
    assert len(FORMATS) == len({form.name for form in FORMATS})


def test_the_page_says_where_no_real_file_was_tried():
    rows = [line for line in _table().splitlines() if line.startswith("| ")][1:]
    tried = [row for row in rows if "real rows" in row]
    assert tried
    assert all("no real file tried" in row for row in rows if row not in tried)


@pytest.mark.parametrize(
    "name",
    [
        "wigle_1.4_sample.csv",
        "wigle_1.6_sample.csv",
        "opencellid_measurements_app_export_sample.csv",
        "opencellid_measurements_app_export_sample2.csv",
        "opencellid_upload_sample.json",
        "opencellid_upload_towercollector_sample.csv",
    ],
)
def test_all_but_one_in_a_hundred_cells_of_a_real_sample_are_read(name):
    source = SAMPLES / name
    if not source.exists():
        pytest.skip("CELLWALK_FORMATS names no folder with it; it is somebody's track")
    rows = list(recognise(source).read(source))
    bad = [
        row for row in rows if isinstance(row, BadRow) and "stands for an unknown" not in row.why
    ]
    n_read = sum(isinstance(row, Sighting) for row in rows)
    assert n_read > 0
    assert len(bad) <= 0.01 * (n_read + len(bad)), bad[:3]
