"""The files that change a reading's type are those that ARCHITECTURE.md lists."""

from tests.kit.way_of_a_reading import as_listed, list_of_the_page, way_of_a_reading


def test_the_way_of_a_reading_is_as_described(tmp_path):
    way = way_of_a_reading(tmp_path)
    for path, changes in way.changes.items():
        print(f"{path}: {'; '.join(changes)}")
    assert {"logger/device/port.py", "postproc/results.py"} <= set(way.holders)
    files = set(way.changes)
    if as_listed(files) != list_of_the_page():
        # on a busy machine another value may equal one of the levels, but seldom twice
        (tmp_path / "again").mkdir()
        files &= set(way_of_a_reading(tmp_path / "again").changes)
    assert as_listed(files) == list_of_the_page()
