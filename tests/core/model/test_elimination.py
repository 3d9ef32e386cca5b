import numpy as np
import pytest

from logger.core.model.elimination import (
    eliminate,
    inverse,
    packed_index,
    pivots,
    side,
    solution,
)


@pytest.fixture(params=[1, 2, 5])
def systems(request):
    """Matrices (3, 4, q + 1, q + 1) that are positive definite, and the same packed."""
    q = request.param
    rows = np.random.default_rng(q).normal(size=(3, 4, 2 * q + 3, q + 1))
    matrix = np.swapaxes(rows, -1, -2) @ rows
    i, j = np.tril_indices(q + 1)
    return matrix, np.moveaxis(matrix[..., i, j], -1, 0).copy()


def test_entries_are_numbered_by_rows():
    i, j = np.tril_indices(5)
    assert [packed_index(*pair) for pair in zip(i, j, strict=True)] == list(range(15))
    assert side(np.zeros((15, 2))) == 5


def test_solution_inverse_determinant_and_remainder(systems):
    matrix, packed = systems
    a, b, c = matrix[..., 1:, 1:], matrix[..., 1:, 0], matrix[..., 0, 0]
    exact = np.linalg.solve(a, b[..., None])[..., 0]
    eliminate(packed)
    for count in range(1, a.shape[-1] + 1):
        found = np.moveaxis(solution(packed, count), 0, -1)
        np.testing.assert_allclose(found, exact[..., :count], rtol=1e-9)
        block = np.moveaxis(inverse(packed, count), (0, 1), (-2, -1))
        np.testing.assert_allclose(block, np.linalg.inv(a)[..., :count, :count], rtol=1e-9)
    np.testing.assert_allclose(np.prod(pivots(packed), axis=0), np.linalg.det(a), rtol=1e-9)
    np.testing.assert_allclose(packed[0], c - np.sum(b * exact, axis=-1), rtol=1e-9)


def test_elimination_may_stop_at_an_unknown():
    rows = np.random.default_rng(1).normal(size=(9, 4))
    matrix = rows.T @ rows
    packed = matrix[np.tril_indices(4)]
    eliminate(packed, 2)
    kept, gone = matrix[:2, :2], matrix[:2, 2:]
    schur = kept - gone @ np.linalg.inv(matrix[2:, 2:]) @ gone.T
    np.testing.assert_allclose(packed[:3], schur[np.tril_indices(2)], rtol=1e-9)
