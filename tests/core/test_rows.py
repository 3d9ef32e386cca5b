import numpy as np
import pytest

from logger.core.rows import numbered_texts


@pytest.mark.parametrize("width", [1, 8, 16, 48, 50])
def test_numbered_texts_are_those_of_numpy(width):
    rng = np.random.default_rng(width)
    letters = rng.integers(97, 99, (3000, width)).astype(np.uint8)
    letters[np.arange(width) >= rng.integers(0, width + 1, 3000)[:, None]] = 0
    column = letters.reshape(-1).view(f"S{width}")
    texts, which = numbered_texts(column)
    expected, inverse = np.unique(column, return_inverse=True)
    np.testing.assert_array_equal(texts, expected)
    np.testing.assert_array_equal(which, inverse)


def test_numbered_texts_with_one_hash_are_told_apart(monkeypatch):
    monkeypatch.setattr("logger.core.rows._HASH_FACTOR", np.uint64(0))
    texts, which = numbered_texts(np.array([b"b", b"a", b"b", b""]))
    assert texts.tolist() == [b"", b"a", b"b"]
    assert which.tolist() == [2, 1, 2, 0]


def test_no_texts_have_no_numbers():
    texts, which = numbered_texts(np.array([], "S4"))
    assert len(texts) == len(which) == 0
