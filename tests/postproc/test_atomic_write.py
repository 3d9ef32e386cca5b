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
