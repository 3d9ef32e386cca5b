"""A planted fault stands where its expression stands, and nothing of it is left afterwards."""

import pytest

from tools import planted_faults as tool

CODE = '''"""A module with letters of two bytes: ß."""
def distance(höhe, x_m):
    return 5.0 * (höhe * höhe + max(
        x_m, 1.0)) + höhe * x_m
'''
TEST = """from postproc.one import distance
def test_distance(): assert distance(2.0, 3.0) == 41.0
"""


@pytest.fixture
def tree(tmp_path):
    (tmp_path / "postproc").mkdir()
    (tmp_path / "tests").mkdir()
    (tmp_path / "postproc/__init__.py").touch()
    (tmp_path / "postproc/one.py").write_text(CODE)
    (tmp_path / "tests/test_one.py").write_text(TEST)
    return tmp_path


def fault(old, new, **more):
    return tool.Fault("room", "what", old, new, "tests", **more)


@pytest.mark.parametrize(
    ("old", "new", "is_noticed", "text"),
    [
        ("max(A__, 1.0)", "max(A__, 4.0)", True, "test_distance"),
        ("A__ * A__ + B__", "A__ + B__", True, "test_distance"),
        ("max(A__, 1.0)", "max(A__, 2.0)", False, "not noticed"),
        ("min(A__, 1.0)", "A__", False, "no longer there: min(A__, 1.0)"),
        ("höhe * A__", "höhe", False, "stands in 2 places: postproc/one.py:3, postproc/one.py:4"),
    ],
)
def test_a_fault_is_noticed_or_it_is_said_why_not(tree, old, new, is_noticed, text):
    ((_, found, why),) = tool.rows([fault(old, new)], tree)
    assert found is is_noticed, why
    assert text in why
    assert (tree / "postproc/one.py").read_text() == CODE


def test_a_fault_is_planted_everywhere_where_it_may_be(tree):
    places = tool.places(fault("höhe * A__", "höhe + A__"), tool.read_trees(tree))
    tool.plant(places)
    assert (tree / "postproc/one.py").read_text() == CODE.replace(
        "höhe * höhe", "(höhe + höhe)"
    ).replace("höhe * x_m", "(höhe + x_m)")


def test_a_test_is_found_by_its_name_wherever_it_moved(tree):
    moved = tree / "tests/deep/test_two.py"
    moved.parent.mkdir()
    (tree / "tests/test_one.py").rename(moved)
    named = fault("a", "b", tests=("test_distance[x]",))
    assert tool.targets(named, tree) == ["tests/deep/test_two.py::test_distance[x]"]
    assert tool.targets(fault("a", "b", tests=("test_gone",)), tree) == ["tests"]
    gone = fault("max(A__, 1.0)", "1.0", tests=("test_gone",))._replace(folder="gone")
    ((_, is_noticed, why),) = tool.rows([gone], tree)
    assert (is_noticed, why) == (False, "its tests are no longer there: gone")


def test_there_are_twenty_rooms():
    assert len({one.room for one in tool.FAULTS}) == len(tool.FAULTS) == 20
