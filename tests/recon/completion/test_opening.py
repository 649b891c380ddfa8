import numpy as np
import pytest

from medor_cloth.winding import rim_edges, winding_grid, winding_numbers
from medor_recon.completion.opening import best_threshold, closed_surface, on_cloth, opened
from medor_wire.errors import ReconstructionFailed


def tube(radius: float = 0.2, low: float = 0.25, high: float = 0.75, around: int = 48, along: int = 20):
    """An open tube about the body axis in the middle of the cube, wound outwards."""
    angle, z = np.meshgrid(np.arange(around) * 2 * np.pi / around, np.linspace(low, high, along), indexing="ij")
    vertices = np.stack([0.5 + radius * np.cos(angle), 0.5 + radius * np.sin(angle), z], axis=-1).reshape(-1, 3)
    i, k = np.meshgrid(np.arange(around), np.arange(along - 1), indexing="ij")
    a, b = i * along + k, (i + 1) % around * along + k
    faces = np.stack([np.stack([a, b, b + 1], -1), np.stack([a, b + 1, a + 1], -1)], axis=2).reshape(-1, 3)
    return vertices, faces


@pytest.fixture(scope="module")
def field() -> np.ndarray:
    return winding_grid(*tube(), 48)


def test_the_level_surface_is_closed_and_wound_outwards(field):
    vertices, faces, steepness = closed_surface(field)
    assert len(rim_edges(faces)) == 0
    inside, outside = np.array([[0.5, 0.5, 0.5]]), np.array([[0.9, 0.9, 0.5]])
    assert winding_numbers(inside, vertices, faces) == pytest.approx(1, abs=1e-3)
    assert winding_numbers(outside, vertices, faces) == pytest.approx(0, abs=1e-3)
    assert len(steepness) == len(vertices)


def test_axes_are_not_exchanged():
    vertices, faces = tube(low=0.1, high=0.6)
    found, _, _ = closed_surface(winding_grid(vertices * (1, 0.8, 1), faces, 40))
    cloth = vertices * (1, 0.8, 1)
    np.testing.assert_allclose(found.max(axis=0)[:2], cloth.max(axis=0)[:2], atol=1 / 39)
    assert found[:, 2].max() < 0.7


def test_both_ends_of_a_tube_are_opened_again(field):
    vertices, faces, steepness = closed_surface(field)
    true = on_cloth(vertices, tube(along=60)[0], within=0.02)
    kept, left = opened(vertices, faces, steepness, best_threshold(steepness, true))
    ends = kept[np.unique(rim_edges(left))]
    assert (ends[:, 2] > 0.7).any()
    assert (ends[:, 2] < 0.3).any()
    middle = np.linalg.norm(kept[:, :2] - 0.5, axis=1) < 0.1
    assert not middle.any()
    height = kept[:, 2]
    assert height.min() < 0.3
    assert height.max() > 0.7
    np.testing.assert_allclose(np.linalg.norm(kept[:, :2] - 0.5, axis=1).mean(), 0.2, atol=0.01)


def test_the_best_threshold_separates_what_can_be_separated():
    steepness = np.array([0.1, 0.2, 0.3, 0.6, 0.7, 0.8])
    threshold = best_threshold(steepness, steepness > 0.5)
    assert 0.3 <= threshold < 0.6


def test_precision_counts_three_times_as_much_as_recall():
    steepness = np.concatenate([np.full(50, 0.2), np.full(50, 0.4)])
    half_right = np.concatenate([np.arange(50) % 2 == 0, np.ones(50, bool)])
    assert best_threshold(steepness, half_right) >= 0.2


@pytest.mark.parametrize("winding", [np.zeros((9, 9, 9)), np.full((9, 9, 9), np.nan)])
def test_a_field_without_an_inside_is_refused(winding):
    with pytest.raises(ReconstructionFailed, match="no inside from outside"):
        closed_surface(winding)


def test_a_field_without_cloth_is_refused(field):
    with pytest.raises(ReconstructionFailed, match="no cloth"):
        opened(*closed_surface(field), threshold=10.0)
