import numpy as np
import pytest

from medor_cloth.coverage import coverage
from medor_dynamics.physics import Physics
from medor_dynamics.rewards import DIVERGED_PENALTY
from medor_wire.bus import Call
from medor_wire.errors import BadRequest, Cancelled
from medor_wire.messages import ClothMesh, Message, Reward, RolloutProgress

ABOVE = np.array([0, 0, 0.01], np.float32)


@pytest.fixture(scope="module")
def physics() -> Physics:
    return Physics(threads=2)


def corner_pull(mesh: ClothMesh) -> tuple[np.ndarray, np.ndarray]:
    """From the corner of least x and y towards the middle, and a pick that grasps nothing."""
    corner = mesh.vertices[mesh.vertices[:, :2].sum(axis=1).argmin()] + ABOVE
    far = np.array([0, 0, 1], np.float32)
    return np.stack([corner, far]), np.stack([corner + [0.1, 0.1, 0.05], far]).astype(np.float32)


def test_a_fold_covers_less_and_an_empty_pick_leaves_the_cloth_as_it_is(physics, sheet, request_for):
    mesh = sheet()
    rollouts = physics.roll_out(request_for(mesh, *corner_pull(mesh)), Call())
    lying = coverage(mesh.vertices, mesh.faces)
    assert rollouts.rewards[0] < 0.8 * lying
    assert rollouts.rewards[1] == pytest.approx(lying, rel=0.02)
    np.testing.assert_allclose(rollouts.positions[1][:, :2], mesh.vertices[:, :2], atol=2e-3)
    assert rollouts.rewards[0] == pytest.approx(coverage(rollouts.positions[0], mesh.faces))


def test_rollouts_do_not_depend_on_threads_or_on_what_was_rolled_out_before(physics, sheet, request_for):
    mesh = sheet()
    picks, places = (np.repeat(part, 3, axis=0) for part in corner_pull(mesh))
    one = Physics(threads=1).roll_out(request_for(mesh, picks, places), Call())
    two = physics.roll_out(request_for(mesh, picks, places), Call())
    np.testing.assert_array_equal(one.positions, two.positions)
    np.testing.assert_array_equal(one.rewards, two.rewards)


def test_a_mesh_without_panels_is_at_rest_as_it_lies(physics, sheet, request_for):
    """Stretched cloth with panels pulls itself together, without them it has always been that long."""
    far = np.array([[0, 0, 1.0]])
    for panels in (True, False):
        mesh = sheet(panels=panels)
        stretched = mesh.model_copy(update={"vertices": mesh.vertices * np.array([1.1, 1.1, 1], np.float32)})
        after = physics.roll_out(request_for(stretched, far, far), Call()).positions[0]
        width = np.ptp(after[:, 0]) / np.ptp(mesh.vertices[:, 0])
        assert width == pytest.approx(1.0 if panels else 1.1, abs=0.03)


def test_cloth_in_pieces_over_nothing_stays_finite(physics, sheet, request_for):
    """What a camera sees: patches at several heights with nothing modelled below, one of them a lone triangle."""
    low, high = sheet(side=0.1), sheet(side=0.06, height=0.04)
    lone = np.array([[0.2, 0.2, 0.02], [0.22, 0.2, 0.02], [0.2, 0.22, 0.02]], np.float32)
    vertices = np.concatenate([low.vertices, high.vertices + np.array([0.01, 0, 0], np.float32), lone])
    starts = (0, len(low.vertices), len(low.vertices) + len(high.vertices))
    faces = [low.faces, high.faces + starts[1], np.array([[0, 1, 2]]) + starts[2]]
    mesh = ClothMesh(
        vertices=vertices,
        faces=np.concatenate(faces).astype(np.int32),
        category="dress",
        visible=np.ones(len(vertices), bool),
    )
    picks = vertices[[0, 40, len(low.vertices), len(vertices) - 1]] + ABOVE
    rollouts = physics.roll_out(request_for(mesh, picks, picks + np.array([0.1, 0, 0.1], np.float32)), Call())
    assert np.isfinite(rollouts.positions).all()
    assert (rollouts.rewards > 0).all()
    assert rollouts.positions[..., 2].min() > -0.001


def test_a_diverged_rollout_is_never_the_best_one(monkeypatch, sheet, request_for):
    def explode(solver, positions, picks, places, **_):
        after = np.repeat(np.asarray(positions)[None], len(picks), axis=0)
        after[1, 3] = np.nan
        return after

    monkeypatch.setattr("medor_dynamics.physics.rollouts", explode)
    mesh = sheet()
    rollouts = Physics(threads=1).roll_out(request_for(mesh, *corner_pull(mesh)), Call())
    assert rollouts.rewards[0] == coverage(mesh.vertices, mesh.faces)
    assert rollouts.rewards[1] == rollouts.rewards[0] - DIVERGED_PENALTY
    np.testing.assert_array_equal(rollouts.positions[1], mesh.vertices)


def test_progress_counts_every_candidate(physics, sheet, request_for):
    mesh = sheet()
    picks, places = (np.repeat(part, 2, axis=0) for part in corner_pull(mesh))
    told: list = []
    physics.roll_out(request_for(mesh, picks, places), Call(progress=told.append))
    assert told == [RolloutProgress(done=done, total=4) for done in (1, 2, 3, 4)]


def test_cancelling_stops_before_the_next_candidate(sheet, request_for):
    mesh = sheet()
    picks, places = (np.repeat(part, 50, axis=0) for part in corner_pull(mesh))
    told: list = []

    def cancel_after_the_first(message: Message) -> None:
        told.append(message)
        call.withdraw()

    call = Call(progress=cancel_after_the_first)
    with pytest.raises(Cancelled):
        Physics(threads=1).roll_out(request_for(mesh, picks, places), call)
    assert len(told) == 1


def test_a_mesh_that_cannot_be_cloth_is_said_so(physics, sheet, request_for):
    mesh = sheet()
    collapsed = mesh.model_copy(update={"vertices": np.zeros_like(mesh.vertices)})
    with pytest.raises(BadRequest, match="cannot be cloth"):
        physics.roll_out(request_for(collapsed, *corner_pull(mesh)), Call())


def test_canonicalize_rewards_the_state_that_is_the_goal(physics, sheet, request_for):
    mesh = sheet()
    turned = mesh.vertices[:, [1, 0, 2]] * np.array([-1, 1, 1], np.float32) + np.array([0.05, 0, 0], np.float32)
    for matched in (True, False):
        reward = Reward(task="canonicalize", goals=turned[None], matched=matched)
        rewards = physics.roll_out(request_for(mesh, *corner_pull(mesh), reward), Call()).rewards
        assert rewards[0] < rewards[1]
        assert rewards[1] == pytest.approx(0, abs=2e-3)


def test_goals_that_do_not_fit_the_mesh_are_said_so(physics, sheet, request_for):
    mesh = sheet()
    reward = Reward(task="canonicalize", goals=mesh.vertices[None, :5])
    with pytest.raises(BadRequest, match="goals"):
        physics.roll_out(request_for(mesh, *corner_pull(mesh), reward), Call())
