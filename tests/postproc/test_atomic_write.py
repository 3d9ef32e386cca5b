import subprocess
import sys

import pytest

from logger.core.errors import RunFileError
from postproc.atomic_write import whole_file


def test_a_file_appears_when_it_is_whole(tmp_path):
    path = tmp_path / "a.txt"
    with whole_file(path) as part:
        part.write_text("whole")
        assert not path.exists()
    assert path.read_text() == "whole"
    assert list(tmp_path.iterdir()) == [path]


def test_two_programs_that_write_one_file_each_write_it_whole(tmp_path):
    path = tmp_path / "a.txt"
    other = (
        "import sys; from pathlib import Path; from postproc.atomic_write import whole_file\n"
        "with whole_file(Path(sys.argv[1])) as part: part.write_text('theirs')"
    )
    with whole_file(path) as part, part.open("w") as file:
        file.write("ours, ")
        file.flush()
        subprocess.run([sys.executable, "-c", other, str(path)], check=True)
        assert path.read_text() == "theirs"
        file.write("whole")
    assert path.read_text() == "ours, whole"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    "failure",
    [
        OSError(28, "No space left on device"),
        OSError(28, "Unable to synchronously create file (name = 'a.part', errno = 28)"),  # HDF5
        RuntimeError("the writer gave up"),
    ],
)
def test_a_failure_leaves_what_was_there(tmp_path, failure):
    path = tmp_path / "a.txt"
    path.write_text("before")
    with (
        pytest.raises(RunFileError, match="cannot write .*: (No space|the writer)"),
        whole_file(path) as part,
    ):
        part.write_text("half")
        raise failure
    assert path.read_text() == "before"
    assert list(tmp_path.iterdir()) == [path]


def test_a_missing_folder_is_named(tmp_path):
    with pytest.raises(RunFileError, match="no such folder"), whole_file(tmp_path / "none/a.txt"):
        pass
