import numpy as np
import pytest

from medor_cloth.alignment import canonical_cost
from medor_cloth.coverage import coverage
from medor_cloth.garment import generate
from medor_dynamics.flatten import Flattener
from medor_wire.bus import Call
from medor_wire.errors import BadRequest
from medor_wire.messages import FlattenRequest


@pytest.fixture(scope="module")
def trousers():
    return generate("trousers", 800_003, edge_m=0.02)


def request_of(garment, panels: bool = True) -> FlattenRequest:
    return FlattenRequest(
        category=garment.category,
        canonical=garment.vertices,
        faces=garment.faces,
        panel_uv=garment.panel_uv if panels else None,
    )


@pytest.mark.parametrize("panels", [True, False])
def test_goals_lie_flat_one_per_symmetry_element(trousers, panels):
    goals = Flattener().flatten(request_of(trousers, panels), Call())
    assert goals.goals.shape == (2, len(trousers.vertices), 3)
    assert np.percentile(goals.goals[..., 2], 95) < 0.015
    assert goals.flat_coverage_m2 == coverage(goals.goals[0], trousers.faces)


def test_the_second_goal_of_trousers_lies_on_the_other_side(trousers):
    first, second = Flattener().flatten(request_of(trousers), Call()).goals
    front = trousers.vertices[:, 1] < np.percentile(trousers.vertices[:, 1], 20)
    assert first[front, 2].mean() > first[~front, 2].mean()
    assert second[front, 2].mean() < second[~front, 2].mean()
    assert canonical_cost(first, second[None]) > 0.02


def test_the_same_mesh_is_flattened_once(trousers, monkeypatch):
    flattener = Flattener()
    first = flattener.flatten(request_of(trousers), Call())
    monkeypatch.setattr("medor_dynamics.flatten.goal_set", lambda garment: pytest.fail("flattened again"))
    assert flattener.flatten(request_of(trousers), Call()) is first


def test_a_mesh_that_cannot_be_cloth_is_said_so(trousers):
    flat = request_of(trousers, panels=False).model_copy(update={"canonical": np.zeros_like(trousers.vertices)})
    with pytest.raises(BadRequest, match="laid flat"):
        Flattener().flatten(flat, Call())
