import pytest

from logger.core.errors import RunFileError
from postproc.interop.json_lines import objects
from postproc.interop.sighting import BadRow


def test_lines_and_a_list_have_the_same_objects(tmp_path):
    (tmp_path / "a").write_text('{"a": 1}\n\n{"a": 2\n7\n')
    (tmp_path / "b").write_text('[{"a": 1}, 7]')
    assert list(objects(tmp_path / "a")) == [
        (1, {"a": 1}),
        BadRow(3, "it is no JSON"),
        BadRow(4, "it is no JSON object"),
    ]
    assert list(objects(tmp_path / "b")) == [(1, {"a": 1}), BadRow(2, "it is no JSON object")]


@pytest.mark.parametrize("text", ['[{"a": 1}', "[" * 100_000])
def test_a_damaged_list_is_an_error(tmp_path, text):
    (tmp_path / "a").write_text(text)
    with pytest.raises(RunFileError, match="no JSON file"):
        list(objects(tmp_path / "a"))
