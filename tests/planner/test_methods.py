from dataclasses import replace

import pytest

from medor_cloth.coverage import coverage
from medor_planner.methods import METHODS, ORACLE, method_named
from medor_wire import endpoints
from medor_wire.errors import BadRequest
from medor_wire.messages import PlanRequest

TABLE = (
    "oracle", "oracle-mesh", "medor", "medor+physics", "no-consistency", "joint", "no-finetuning", "no-relative",
    "partial-reward", "garmentnets", "visible", "random",
)  # fmt: skip
"""Rows of the paper's ablation table, and the two baselines."""


@pytest.mark.parametrize("name", TABLE)
def test_every_row_of_the_table_is_a_method(name):
    assert method_named(name).name == name


def test_methods_are_all_different():
    assert len({(m.recon, m.dynamics, m.goals, m.visible_reward, m.judged) for m in METHODS.values()}) == len(METHODS)


def test_with_physics_differs_from_the_learned_method_in_dynamics_alone():
    pairs = [(METHODS[name.removesuffix("+physics")], each) for name, each in METHODS.items() if "+physics" in name]
    assert {learned.name for learned, _ in pairs} >= {"medor", "partial-reward", "garmentnets"}
    for learned, physics in pairs:
        assert (learned.dynamics, physics.dynamics) == ("learned", "layerless")
        assert (learned.recon, learned.goals, learned.visible_reward) == (
            physics.recon,
            physics.goals,
            physics.visible_reward,
        )


def test_the_true_mesh_is_judged_as_a_completed_one_is():
    true, completed = method_named("oracle-mesh+judge"), method_named("medor+judge")
    assert true == replace(completed, name=true.name, recon=None)


def test_partial_reward_sees_what_medor_sees_and_judges_less():
    partial, medor = method_named("partial-reward"), method_named("medor")
    assert (partial.recon, partial.goals) == (medor.recon, medor.goals)
    assert partial.visible_reward
    assert not medor.visible_reward


def test_an_unknown_method_is_told_what_there_is():
    with pytest.raises(BadRequest, match=r"medor\+physics.*'telepathy'"):
        method_named("telepathy")


@pytest.mark.parametrize("task", ["flatten", "canonicalize"])
def test_a_partial_reward_leaves_hidden_cloth_out(lab, monkeypatch, task):
    """Flatten: less covered than there is. Canonicalize: another distance."""
    monkeypatch.setitem(METHODS, "seen", replace(ORACLE, name="seen", visible_reward=True))
    lying = {
        name: lab.bus.ask(endpoints.PLAN, PlanRequest(category="tshirt", task=task, method=name, candidates=1))
        for name in ("oracle", "seen")
    }
    mesh = lying["seen"].mesh
    assert not mesh.visible.all()
    if task == "flatten":
        seen = coverage(mesh.vertices, mesh.faces[mesh.visible[mesh.faces].all(axis=1)])
        assert lying["seen"].no_op_reward == pytest.approx(seen, rel=0.02)
    assert lying["seen"].no_op_reward != pytest.approx(lying["oracle"].no_op_reward, rel=1e-3)
