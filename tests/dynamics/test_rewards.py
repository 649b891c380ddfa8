"""What counts: all of the cloth, or only what was visible before the action."""

import numpy as np
import pytest

from medor_cloth.coverage import coverage
from medor_dynamics.physics import Physics
from medor_dynamics.rewards import rewards
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


def test_goals_are_counted_before_the_hidden_ones_are_left_out(half_hidden):
    with pytest.raises(BadRequest, match="goals"):
        rate(half_hidden, canonical(half_hidden.vertices[half_hidden.visible], visible_only=True), half_hidden.vertices)


def test_backends_roll_the_whole_cloth_out_and_score_what_was_seen(half_hidden, request_for):
    up = np.array([[0, 0, 1.0]])
    rollouts = Physics(threads=1).roll_out(request_for(half_hidden, up, up, VISIBLE), Call())
    assert rollouts.positions.shape[1] == len(half_hidden.vertices)
    assert rollouts.rewards[0] == pytest.approx(coverage(half_hidden.vertices, half_hidden.faces) / 2, rel=0.05)
