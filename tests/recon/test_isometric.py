"""The layout that keeps lengths."""

import numpy as np
import pytest

from medor_cloth.intersection import self_intersections
from medor_recon.refine import ISOMETRIC, PAPER, refine
from medor_recon.refine.binding import Binding
from medor_recon.refine.config import Isometry
from medor_recon.refine.isometric import lay_out

from .crumpled import filled, folded, garment, seen


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(3)


def edges() -> np.ndarray:
    return np.unique(np.sort(garment().faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)


def strain(positions: np.ndarray) -> np.ndarray:
    first, second = edges().T
    now, rest = (np.linalg.norm(x[second] - x[first], axis=1) for x in (positions, garment().vertices))
    return now / rest - 1


def turned(points: np.ndarray, angle: float = 0.7) -> np.ndarray:
    cos, sin = np.cos(angle), np.sin(angle)
    return points @ np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])


def moved() -> np.ndarray:
    """The garment as it is worn, somewhere else."""
    return turned(garment().vertices.astype(np.float64)) + [0.1, -0.2, 1.0]


def a_third(rng: np.random.Generator) -> np.ndarray:
    count = len(garment().vertices)
    return np.sort(rng.choice(count, count // 3, replace=False))


def test_a_body_that_was_moved_is_found_from_a_third_of_its_points(rng):
    some, true = a_third(rng), moved()
    shrunk = (true - true.mean(axis=0)) * 0.6 + true.mean(axis=0)
    found = lay_out(
        shrunk, garment().vertices, edges(), Binding(some, true[some]), Isometry(doubt_m=1.0, iterations=40)
    )
    assert np.abs(strain(found)).max() < 0.02
    assert np.linalg.norm(found - true, axis=1).max() < 0.002


def test_a_point_with_a_wrong_coordinate_is_not_believed(rng):
    some, true = a_third(rng), moved()
    targets = true[some].copy()
    wrong = rng.choice(len(some), 5, replace=False)
    targets[wrong] += [0.3, 0.0, 0.1]
    found = lay_out(true, garment().vertices, edges(), Binding(some, targets), Isometry())
    assert np.linalg.norm(found - true, axis=1)[some[wrong]].max() < 0.003


def test_the_layout_turns_with_the_table(rng):
    some, view = a_third(rng), folded()
    targets = view[some] + 0.01 * rng.standard_normal((len(some), 3))
    here = lay_out(view, garment().vertices, edges(), Binding(some, targets), Isometry())
    there = lay_out(turned(view), garment().vertices, edges(), Binding(some, turned(targets)), Isometry())
    assert there == pytest.approx(turned(here), abs=1e-9)


def test_without_points_the_garment_stays_in_its_place():
    nothing = Binding(np.empty(0, np.int64), np.empty((0, 3)))
    found = lay_out(moved(), garment().vertices, edges(), nothing, Isometry())
    assert found == pytest.approx(moved(), abs=1e-6)


def test_finetuning_from_it_keeps_lengths_and_explains_the_view(rng):
    view = seen(0.02, rng)
    completed = filled(view)
    paper, ours = (refine(completed, view, config) for config in (PAPER, ISOMETRIC))
    spread = [np.percentile(np.abs(strain(x)), 90) for x in (completed.positions, paper.positions, ours.positions)]
    assert spread[2] < 0.5 * min(spread[:2])
    crossings = [self_intersections(x, completed.faces) for x in (paper.positions, ours.positions)]
    assert crossings[1] < 0.7 * crossings[0]
    assert ours.residual_m < 1.3 * paper.residual_m
    error = [np.linalg.norm(x - folded(), axis=1).mean() for x in (completed.positions, ours.positions)]
    assert error[1] < error[0]
