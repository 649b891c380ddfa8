"""Grasps fail as often as asked, always alike for the same seed, and as the words say."""

import numpy as np
import pytest

from medor_cloth.cloth import Cloth
from medor_cloth.grasp import REACH_M
from medor_cloth.solver import Solver
from medor_sim.grasp_failures import GraspFailures, NextLayer

PICK, PLACE = np.array([0.1, 0.0, 0.02]), np.array([0.0, 0.0, 0.1])


def draws(failures: GraspFailures, count: int = 2000) -> list[str]:
    return [failures.draw(number, PICK, PLACE) for number in range(count)]


def test_by_default_every_grasp_is_good():
    assert set(draws(GraspFailures())) == {"good"}


def test_what_is_certain_always_happens():
    assert set(draws(GraspFailures(miss=1))) == {"missed"}
    assert set(draws(GraspFailures(two_layers=1))) == {"two layers"}
    assert set(draws(GraspFailures(miss=1, two_layers=1))) == {"missed"}


def test_failures_come_as_often_as_asked():
    drawn = draws(GraspFailures(miss=0.2, two_layers=0.3))
    assert drawn.count("missed") / 2000 == pytest.approx(0.2, abs=0.03)
    assert drawn.count("two layers") / 2000 == pytest.approx(0.8 * 0.3, abs=0.03)


def test_the_same_seed_and_action_fail_alike_and_others_otherwise():
    failures = GraspFailures(miss=0.5, seed=1)
    assert draws(failures, 50) == draws(GraspFailures(miss=0.5, seed=1), 50)
    assert draws(failures, 50) != draws(GraspFailures(miss=0.5, seed=2), 50)
    elsewhere = [failures.draw(number, PICK + 0.01, PLACE) for number in range(50)]
    assert draws(failures, 50) != elsewhere


LENGTH, WIDTH, EDGE_M = 17, 5, 0.0125


@pytest.fixture(scope="module")
def strip():
    """The solver of a strip of 20 x 5 cm, and where its vertices lie flat."""
    i, j = np.meshgrid(np.arange(LENGTH), np.arange(WIDTH), indexing="ij")
    flat = np.stack([i.ravel() * EDGE_M, j.ravel() * EDGE_M, np.zeros(i.size)], axis=1).astype(np.float32)
    corner = (np.arange(LENGTH - 1)[:, None] * WIDTH + np.arange(WIDTH - 1)).ravel()
    lower, upper = np.c_[corner, corner + WIDTH, corner + 1], np.c_[corner + 1, corner + WIDTH, corner + WIDTH + 1]
    return Solver(Cloth.from_mesh(flat, np.concatenate([lower, upper]).astype(np.int32))), flat


@pytest.fixture(scope="module")
def folded(strip):
    """The strip folded over itself, at rest, and the vertex at the middle of its upper end."""
    solver, flat = strip
    half = flat[:, 0].max() / 2
    points = flat.copy()
    points[:, 0] = half - np.abs(flat[:, 0] - half)
    points[:, 2] = np.where(flat[:, 0] <= half, 0.003, 0.009)
    return solver, solver.advance(solver.rest(points), 30), LENGTH * WIDTH - WIDTH // 2 - 1


def lift(folded, layers: NextLayer | None):
    solver, cloth, top = folded
    start = cloth.positions[top] + np.array([0, 0, 0.01], np.float32)
    now = solver.placed(cloth, start)
    path = start + np.linspace(0, 1, 31)[1:, None] * np.array([0.0, 0.0, 0.1])
    for frame in range(len(path)):
        now = solver.advance(now, 1, picker_path=path[frame : frame + 1], holding=[True])
        if layers is not None:
            now = layers.follow(frame, now)
    return now


def test_two_layers_rise_together_where_one_alone_would_not(folded):
    _, cloth, top = folded
    layers = NextLayer(folded[0].cloth.edges)
    together, alone = lift(folded, layers), lift(folded, None)
    other = layers.vertex
    assert np.linalg.norm(cloth.positions[other] - cloth.positions[top]) <= REACH_M
    assert together.held == alone.held == top
    assert together.positions[other, 2] > 0.09
    assert alone.positions[other, 2] < 0.03
    beside = together.positions[other] - together.positions[top]
    np.testing.assert_allclose(beside, cloth.positions[other] - cloth.positions[top], atol=0.002)


def test_the_next_layer_is_not_the_neighbourhood(folded):
    solver, _, top = folded
    layers = NextLayer(solver.cloth.edges)
    lift(folded, layers)
    near = {top}
    for _ in range(3):
        near |= {int(v) for edge in solver.cloth.edges if near & set(edge.tolist()) for v in edge}
    assert layers.vertex not in near


def test_a_single_layer_has_no_next_one(strip):
    solver, flat = strip
    layers = NextLayer(solver.cloth.edges)
    lift((solver, solver.rest(flat + [0, 0, 0.003]), 42), layers)
    assert layers.vertex == -1


def test_what_is_let_go_is_let_go(folded):
    solver, _, _ = folded
    layers = NextLayer(solver.cloth.edges)
    held = lift(folded, layers)
    fallen = layers.follow(0, solver.advance(held, 1))
    assert layers.vertex == -1
    assert layers.follow(1, fallen) is fallen
