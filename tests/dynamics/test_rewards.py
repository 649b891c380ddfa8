"""What counts: all of the cloth, or only what was visible before the action."""

import numpy as np
import pytest

from medor_cloth.coverage import coverage
from medor_dynamics.physics import Physics
from medor_dynamics.rewards import rewards, turned_over
from medor_wire.bus import Call
from medor_wire.errors import BadRequest
from medor_wire.messages import ClothMesh, Reward

FLATTEN, VISIBLE = Reward(task="flatten"), Reward(task="flatten", visible_only=True)


@pytest.fixture
def half_hidden(sheet) -> ClothMesh:
    """A sheet whose left half nobody saw."""
    mesh = sheet()
    return mesh.model_copy(update={"visible": mesh.vertices[:, 0] > -1e-6})


def canonical(goal: np.ndarray, **options) -> Reward:
    return Reward(task="canonicalize", goals=goal[None], **options)


def rate(mesh: ClothMesh, reward: Reward, *states: np.ndarray) -> list[float]:
    return rewards(np.stack(states), mesh, reward, threads=1).tolist()


def test_hidden_cloth_does_not_add_to_the_coverage(half_hidden):
    whole, part = (rate(half_hidden, reward, half_hidden.vertices)[0] for reward in (FLATTEN, VISIBLE))
    assert whole == coverage(half_hidden.vertices, half_hidden.faces)
    assert part == pytest.approx(whole / 2, rel=0.01)


def test_where_hidden_cloth_goes_makes_no_difference(half_hidden):
    away = half_hidden.vertices + np.where(half_hidden.visible, 0, 0.3)[:, None].astype(np.float32)
    goal = half_hidden.vertices
    for reward in (VISIBLE, canonical(goal, visible_only=True), canonical(goal, matched=False, visible_only=True)):
        here, there = rate(half_hidden, reward, half_hidden.vertices, away)
        assert here == pytest.approx(there, abs=1e-9)
    for reward in (FLATTEN, canonical(goal), canonical(goal, matched=False)):
        here, there = rate(half_hidden, reward, half_hidden.vertices, away)
        assert here != pytest.approx(there, rel=0.01)


def test_of_cloth_that_is_all_visible_everything_counts(sheet):
    mesh = sheet()
    bent = mesh.vertices * np.array([0.8, 1, 1], np.float32)
    for all_of_it, seen in (
        (FLATTEN, VISIBLE),
        (canonical(mesh.vertices), canonical(mesh.vertices, visible_only=True)),
    ):
        assert rate(mesh, all_of_it, bent) == rate(mesh, seen, bent)


def test_cloth_that_nobody_saw_cannot_be_scored_by_what_was_seen(half_hidden):
    unseen = half_hidden.model_copy(update={"visible": np.zeros_like(half_hidden.visible)})
    with pytest.raises(BadRequest, match="visible"):
        rate(unseen, VISIBLE, unseen.vertices)


def test_cloth_whose_side_is_uncertain_is_rated_against_both(sheet):
    mesh, rng = sheet(), np.random.default_rng(0)
    goal = mesh.vertices * np.array([1, 0.8, 1], np.float32) + rng.normal(0, 0.01, mesh.vertices.shape).astype(
        np.float32
    )
    over = turned_over(goal)
    states = mesh.vertices, goal, over
    right, wrong = (np.array(rate(mesh, canonical(it), *states)) for it in (goal, over))
    for probability in (0.5, 0.7, 1):
        unsure = mesh.model_copy(update={"side_probability": probability})
        expected = probability * right + (1 - probability) * wrong
        assert rate(unsure, canonical(goal), *states) == pytest.approx(expected, abs=1e-7)
    assert right[1] == pytest.approx(0, abs=1e-7)
    assert wrong[1] < -0.01, "a garment on its other side is not the same"


def test_turning_over_turns_a_garment_and_does_not_mirror_it(sheet):
    """Twice is not at all; lengths stay; the lowest becomes the highest; what pointed up points down."""
    mesh = sheet()
    goal = mesh.vertices + np.random.default_rng(0).normal(0, 0.01, mesh.vertices.shape).astype(np.float32)
    over = turned_over(goal)
    np.testing.assert_allclose(turned_over(over), goal, atol=1e-6)
    np.testing.assert_allclose(edges(over, mesh.faces), edges(goal, mesh.faces) * [-1, 1, -1], atol=1e-6)
    assert (over[:, 2].argmin(), over[:, 2].argmax()) == (goal[:, 2].argmax(), goal[:, 2].argmin())
    assert (over[:, 2].min(), over[:, 2].max()) == pytest.approx((goal[:, 2].min(), goal[:, 2].max()), abs=1e-6)


def edges(positions: np.ndarray, faces: np.ndarray) -> np.ndarray:
    return positions[faces[:, 1]] - positions[faces[:, 0]]


def test_goals_are_counted_before_the_hidden_ones_are_left_out(half_hidden):
    with pytest.raises(BadRequest, match="goals"):
        rate(half_hidden, canonical(half_hidden.vertices[half_hidden.visible], visible_only=True), half_hidden.vertices)


def test_backends_roll_the_whole_cloth_out_and_score_what_was_seen(half_hidden, request_for):
    up = np.array([[0, 0, 1.0]])
    rollouts = Physics(threads=1).roll_out(request_for(half_hidden, up, up, VISIBLE), Call())
    assert rollouts.positions.shape[1] == len(half_hidden.vertices)
    assert rollouts.rewards[0] == pytest.approx(coverage(half_hidden.vertices, half_hidden.faces) / 2, rel=0.05)
