import pytest

from logger.core.runfile.meta import (
    IMPORT,
    IMPORT_WITHOUT_TIMES,
    has_times,
    is_import,
    origin_of_copy,
)


@pytest.mark.parametrize(
    ("origin", "imported", "times"),
    [
        ("recorded", False, True),
        ("simulated walk block", False, True),
        ("recorded: import without times of x", False, True),
        (f"{IMPORT} walk.csv", True, True),
        (f"{IMPORT} without times of x", True, True),
        (f"{IMPORT_WITHOUT_TIMES} walk.csv", True, False),
    ],
)
def test_a_shared_copy_is_of_the_kind_of_its_run_and_names_no_file(origin, imported, times):
    assert (is_import(origin), has_times(origin)) == (imported, times)
    copy = origin_of_copy(origin)
    assert (is_import(copy), has_times(copy)) == (imported, times)
    assert "walk" not in copy
    assert origin_of_copy(copy) == copy
