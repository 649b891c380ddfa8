"""The solver against closed-form answers, conservation laws and its promises of exactness."""

import io

import numpy as np
import pytest

from medor_cloth.errors import ClothError
from medor_cloth.solver import ClothState, Solver, SolverConfig
from tests.cloth.sheets import EDGE_M, sheet, solver_of, strain

HALF_THICKNESS = SolverConfig().thickness / 2


def crumpling(seed: int, **constants: float) -> tuple[Solver, ClothState]:
    """A small sheet in the air, thrown together at random."""
    vertices, faces = sheet(9, 9)
    solver = solver_of(vertices, faces, **constants)
    rng = np.random.default_rng(seed)
    state = solver.rest(vertices + [0, 0, 0.05])
    inwards = state.positions.mean(0) - state.positions
    state.velocities[:] = 8 * inwards + rng.normal(0, 0.3, state.velocities.shape)
    return solver, state


def same(one: ClothState, other: ClothState) -> bool:
    a, b = one.to_arrays(), other.to_arrays()
    return a.keys() == b.keys() and all(np.array_equal(a[name], b[name]) for name in a)


def test_free_fall_follows_gravity_and_drag():
    vertices, faces = sheet(4, 4)
    solver = solver_of(vertices, faces)
    state = solver.advance(solver.rest(vertices + [0, 0, 1.0]), 20)
    g, c, t = 9.81, 1.0, 0.2
    fallen = g / c * (t - (1 - np.exp(-c * t)) / c)
    np.testing.assert_allclose(1.0 - state.positions[:, 2], fallen, rtol=0.01)
    np.testing.assert_allclose(state.positions[:, :2], vertices[:, :2], atol=1e-4)


def test_a_hanging_strip_is_as_long_as_its_rest_length():
    vertices, faces = sheet(3, 20)
    solver = solver_of(vertices, faces)
    standing = vertices[:, [0, 2, 1]] + np.array([0, 0, 0.1], np.float32)
    corner = standing[-1]
    state = solver.placed(solver.rest(standing), corner)
    state = solver.advance(state, 150, holding=np.ones(150, bool), settle_speed=0.05)
    assert state.held == len(vertices) - 1
    np.testing.assert_array_equal(state.positions[-1], corner)
    rest = np.hypot(20, 3) * EDGE_M  # it hangs from its corner, the opposite one lowest
    assert corner[2] - state.positions[:, 2].min() == pytest.approx(rest, rel=0.03)
    assert np.percentile(np.abs(strain(solver, state.positions)), 95) < 0.05


def test_momentum_is_kept_without_gravity_and_table_even_through_self_contact():
    solver, state = crumpling(1, gravity=0.0, drag=0.0)
    state.positions[:, 2] += 1.0
    before = state.velocities.mean(0)
    after = solver.advance(state, 20)
    moved = np.linalg.norm(after.velocities - state.velocities, axis=1).mean()
    assert moved > 0.1
    np.testing.assert_allclose(after.velocities.mean(0), before, atol=2e-4)


@pytest.mark.parametrize("friction", [0.2, 0.6])
def test_a_sliding_sheet_stops_where_coulomb_friction_stops_it(friction: float):
    vertices, faces = sheet(5, 5)
    solver = solver_of(vertices, faces, table_friction=friction, drag=0.0)
    state = solver.rest(vertices + [0, 0, HALF_THICKNESS])
    state.velocities[:, 0] = 0.5
    state = solver.advance(state, 60)
    slid = (state.positions - vertices)[:, 0].mean()
    assert slid == pytest.approx(0.5**2 / (2 * friction * 9.81), rel=0.05)


def test_without_friction_a_pulled_sheet_is_dragged_and_with_it_the_far_side_stays():
    vertices, faces = sheet(12, 12)
    drawn = {}
    for name, friction in (("slippery", 0.0), ("rough", 1.2)):
        solver = solver_of(vertices, faces, table_friction=friction, layer_friction=friction)
        state = solver.placed(solver.rest(vertices + [0, 0, HALF_THICKNESS]), [0, 0, 0.0])
        path = np.linspace([0, 0, 0], [0.05, 0.05, 0.05], 51)[1:]
        state = solver.advance(state, 50, picker_path=path, holding=np.ones(50, bool))
        drawn[name] = np.linalg.norm((state.positions - vertices)[-13:, :2], axis=1).mean()
    assert drawn["rough"] < 0.003
    assert drawn["slippery"] > 3 * drawn["rough"]


def test_nothing_enters_the_table_and_a_dropped_sheet_comes_to_rest_unstretched():
    solver, state = crumpling(2)
    for _ in range(30):
        state = solver.advance(state, 5, settle_speed=0.05)
        assert state.positions[:, 2].min() >= HALF_THICKNESS - 1e-7
        if state.settled:
            break
    assert state.settled
    speeds = np.linalg.norm(state.velocities, axis=1)
    assert np.quantile(speeds, 0.99) < 0.05
    assert np.percentile(strain(solver, state.positions), 99) < 0.05


def test_two_layers_rest_one_thickness_apart():
    vertices, faces = sheet(8, 8)
    both = np.concatenate([vertices, vertices + [0.004, 0.003, 0]]).astype(np.float32)
    solver = solver_of(both, np.concatenate([faces, faces + len(vertices)]))
    layers = np.repeat([HALF_THICKNESS, 0.012], len(vertices))
    state = solver.advance(solver.rest(both + np.stack([0 * layers, 0 * layers, layers], 1)), 150, settle_speed=0.02)
    lower, upper = state.positions[:, 2].reshape(2, -1)
    assert np.median(upper - lower) == pytest.approx(2 * HALF_THICKNESS, rel=0.1)
    assert (upper - lower).min() > HALF_THICKNESS


def test_without_layers_all_cloth_rests_on_the_table():
    vertices, faces = sheet(8, 8)
    both = np.concatenate([vertices, vertices + [0.004, 0.003, 0.012]]).astype(np.float32)
    solver = solver_of(both, np.concatenate([faces, faces + len(vertices)]), layers=False)
    state = solver.advance(solver.rest(both + np.array([0, 0, HALF_THICKNESS], np.float32)), 60)
    assert state.positions[:, 2] == pytest.approx(HALF_THICKNESS, abs=1e-5)


def test_layers_do_not_pass_through_each_other_at_speed():
    vertices, faces = sheet(8, 8)
    both = np.concatenate([vertices, vertices + [0.004, 0.003, 0.1]]).astype(np.float32)
    solver = solver_of(both, np.concatenate([faces, faces + len(vertices)]))
    state = solver.rest(both + np.array([0, 0, HALF_THICKNESS], np.float32))
    state.velocities[len(vertices) :, 2] = -2.5
    state = solver.advance(state, 30)
    lower, upper = state.positions[:, 2].reshape(2, 9, 9)[:, 1:-1, 1:-1]  # the rims may turn over
    assert (upper > lower).all()


def test_the_same_start_gives_the_same_bits():
    solver, state = crumpling(3)
    again, twin = crumpling(3)
    assert same(solver.advance(state, 30), again.advance(twin, 30))


def test_advance_leaves_its_input_alone():
    solver, state = crumpling(4)
    kept = state.copy()
    solver.advance(solver.placed(state, state.positions[0]), 10, holding=np.ones(10, bool))
    assert same(state, kept)


def test_a_state_saved_in_flight_with_a_held_vertex_goes_on_to_the_bit():
    solver, state = crumpling(5)
    start = solver.placed(state, state.positions[40])
    path = start.picker + np.linspace([0, 0, 0], [0.05, 0, 0.08], 40)
    holding = np.arange(40) < 25
    whole = solver.advance(start, 40, picker_path=path, holding=holding, settle_speed=0.05)
    now = start
    for begin, end in ((0, 7), (7, 24), (24, 40)):
        now = solver.advance(
            now, end - begin, picker_path=path[begin:end], holding=holding[begin:end], settle_speed=0.05
        )
        file = io.BytesIO()
        np.savez(file, allow_pickle=False, **now.to_arrays())
        file.seek(0)
        with np.load(file) as arrays:
            now = ClothState.from_arrays(dict(arrays))
    assert same(now, whole)
    assert whole.held == -1
    assert whole.frame == 40


def test_finer_meshes_bend_alike():
    """A strip held at one end over the void droops alike for edges of 12 and 6 mm."""
    droop = []
    for edge in (0.012, 0.006):
        n = round(0.12 / edge)
        vertices, faces = sheet(n, n // 4, edge)
        solver = solver_of(vertices, faces, bend_compliance=1e-5)
        state = solver.rest(vertices + [0, 0, 0.3])
        # Symmetric bending over a ridge: a second cloth is not needed, the strip hangs from its middle vertex.
        middle = int(np.abs(vertices - [0.06, vertices[:, 1].mean(), 0]).sum(1).argmin())
        state = solver.placed(state, state.positions[middle])
        state = solver.advance(state, 150, holding=np.ones(150, bool), settle_speed=0.05)
        droop.append(0.3 - state.positions[:, 2].mean())
    assert droop[1] == pytest.approx(droop[0], rel=0.25)


@pytest.mark.parametrize(
    ("positions", "message"), [(np.zeros((3, 3)), r"\(25, 3\)"), (np.full((25, 3), np.nan), "finite")]
)
def test_positions_that_do_not_fit_are_refused(positions, message):
    vertices, faces = sheet(4, 4)
    with pytest.raises(ClothError, match=message):
        solver_of(vertices, faces).rest(positions)


def test_a_path_of_another_length_is_refused():
    vertices, faces = sheet(4, 4)
    solver = solver_of(vertices, faces)
    with pytest.raises(ClothError, match="path"):
        solver.advance(solver.rest(vertices), 5, picker_path=np.zeros((4, 3)))


def test_a_state_without_an_array_is_refused():
    vertices, faces = sheet(4, 4)
    arrays = solver_of(vertices, faces).rest(vertices).to_arrays()
    del arrays["velocities"]
    with pytest.raises(ClothError, match="velocities"):
        ClothState.from_arrays(arrays)
