from dataclasses import replace

import numpy as np
import pytest

from medor_cloth.alignment import canonical_cost
from medor_cloth.cloth import Cloth
from medor_cloth.coverage import coverage
from medor_cloth.garment import SYMMETRY_ORDER, Garment, generate
from medor_cloth.goals import flattened, goal_set, solver_of
from medor_cloth.intersection import self_intersections
from medor_cloth.solver import Solver, SolverConfig


@pytest.fixture(scope="module", params=sorted(SYMMETRY_ORDER))
def garment(request) -> Garment:
    return generate(request.param, 800003, edge_m=0.018)


@pytest.fixture(scope="module")
def goals(garment: Garment) -> np.ndarray:
    return goal_set(garment)


def test_there_is_a_flat_pose_for_each_element_of_the_symmetry(garment: Garment, goals: np.ndarray):
    assert goals.shape == (SYMMETRY_ORDER[garment.category], len(garment.vertices), 3)
    assert goals.dtype == np.float32
    areas = [coverage(goal, garment.faces) for goal in goals]
    assert min(areas) > 0.9 * max(areas)
    for goal in goals:
        assert self_intersections(goal, garment.faces) <= 0.005 * len(garment.faces)
        assert np.quantile(goal[:, 2], 0.75) < 0.012  # but for the ridges of folds
        np.testing.assert_allclose(goal[:, :2].mean(0), 0, atol=1e-5)


def test_the_poses_differ_and_keep_the_body_axis(garment: Garment, goals: np.ndarray):
    for i, goal in enumerate(goals):
        others = np.delete(goals, i, axis=0)
        assert len(others) == 0 or canonical_cost(goal, others) > 0.01
        along = np.corrcoef(goal[:, 1], garment.vertices[:, 2])[0, 1]
        assert along > 0.97


def test_half_a_turn_swaps_left_and_right_and_front_and_back_but_not_the_waist(garment: Garment, goals: np.ndarray):
    order = len(goals)
    if order == 1:
        pytest.skip("no symmetry")
    front, back = goals[0], goals[order // 2]
    np.testing.assert_allclose(back[:, 0], -front[:, 0], atol=0.02)
    np.testing.assert_allclose(back[:, 1] - back[:, 1].mean(), front[:, 1] - front[:, 1].mean(), atol=0.02)
    assert coverage(back, garment.faces) == pytest.approx(coverage(front, garment.faces), rel=0.02)
    assert np.corrcoef(front[:, 2], garment.vertices[:, 1])[0, 1] < -0.5
    assert np.corrcoef(back[:, 2], garment.vertices[:, 1])[0, 1] > 0.5


def test_the_flat_area_does_not_hang_on_numerical_settings(garment: Garment):
    cloth = Cloth.from_mesh(garment.vertices, garment.faces, garment.panel_uv)
    areas = [
        coverage(flattened(garment, Solver(cloth, config)).positions, garment.faces)
        for config in (
            SolverConfig(),
            SolverConfig(substeps=18),
            SolverConfig(bend_compliance=3e-4),
            SolverConfig(spring_damping=0.2),
        )
    ]
    assert np.ptp(areas) < 0.02 * areas[0]


def test_a_garment_without_panels_flattens_too():
    garment = generate("trousers", 800003, edge_m=0.018)
    worn = replace(garment, panel_uv=None)
    flat = coverage(flattened(garment).positions, garment.faces)
    solver = solver_of(worn)
    assert coverage(flattened(worn, solver).positions, worn.faces) == pytest.approx(flat, rel=0.1)
