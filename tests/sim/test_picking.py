"""The same pull by the flying picker and by the arm; what the arm refuses; grasps that fail."""

import numpy as np
import pytest

from medor_cloth.picker import pull
from medor_sim.grasp_failures import GraspFailures
from medor_sim.panda import plan
from medor_sim.picking import by_panda, by_picker
from medor_sim.scene import Scene
from medor_wire.bus import Call
from medor_wire.errors import EmergencyStopped, OutOfReach, Refused
from medor_wire.messages import ClearStop, EmergencyStop

LIFT = np.array([0.0, 0.0, 0.01])


def corner(positions: np.ndarray) -> np.ndarray:
    """Picker centre over the vertex farthest along x + y."""
    return positions[positions[:, :2].sum(axis=1).argmax()] + LIFT


def go() -> None:
    """Nothing stops it."""


@pytest.fixture(scope="module")
def scene(wardrobe) -> Scene:
    return Scene.begin(wardrobe.generated("skirt", 800001), "flat", 0)


@pytest.fixture
def arm(world):
    world.arm.park()
    return world.arm


def test_the_held_vertex_follows_the_tool(scene, arm):
    pick = corner(scene.cloth.positions)
    place = pick + [-0.1, -0.05, 0.06]
    motion = plan(arm, pick, place)
    engine, grip = scene.piece.engine, int(motion.holding.argmax())
    cloth = engine.placed(scene.cloth, motion.poses.points[grip - 1])
    held, offset = -1, np.zeros(3)
    for frame in np.flatnonzero(motion.holding):
        tool = motion.poses.points[frame]
        cloth = engine.advance(cloth, 1, picker_path=tool[None], holding=[True])
        if held < 0:
            held, offset = cloth.held, cloth.positions[cloth.held] - tool
        assert cloth.held == held >= 0
        assert np.linalg.norm(cloth.positions[held] - tool - offset) < 0.001
    assert np.linalg.norm(offset) < 0.0213


def test_the_arm_does_what_the_flying_picker_does(scene, arm):
    """Same grasp, same way: the cloth ends nearly alike, though the fingers push and the ramps take time."""
    pick = corner(scene.cloth.positions)
    place = pick + [-0.12, -0.06, 0.05]
    flown = by_picker(scene, pick, place, "good", go)
    done = by_panda(scene, plan(arm, pick, place), "good", go)
    assert flown.grasped
    assert done.grasped
    apart = np.linalg.norm(flown.scene.cloth.positions - done.scene.cloth.positions, axis=1)
    moved = np.linalg.norm(flown.scene.cloth.positions - scene.cloth.positions, axis=1)
    assert apart.mean() < 0.25 * moved.mean()
    assert flown.scene.score().coverage_m2 == pytest.approx(done.scene.score().coverage_m2, rel=0.1)


def test_the_same_motion_gives_the_same_cloth_to_the_bit(scene, arm):
    pick = corner(scene.cloth.positions)
    motion = plan(arm, pick, pick + [-0.05, 0, 0.03])
    one, other = (by_panda(scene, motion, "good", go).scene.cloth.positions for _ in range(2))
    assert np.array_equal(one, other)


@pytest.mark.parametrize("executor", ["picker", "panda"])
def test_a_missed_grasp_catches_nothing_and_says_so(bench, executor):
    bench.reset("flat")
    before = bench.positions()
    pick = corner(before)
    bench.simulator._failures = GraspFailures(miss=1)
    outcome = bench.act("missed", pick, [0.0, 0.0, 0.1], executor=executor)
    assert not outcome.grasped
    assert "missed" in outcome.detail
    assert np.linalg.norm(bench.positions() - before, axis=1).max() < 0.03  # what the fingers brushed aside
    bench.simulator._failures = GraspFailures()
    again = bench.act("caught", pick, [0.0, 0.0, 0.1], executor=executor)
    assert again.grasped
    assert "missed" not in again.detail


@pytest.mark.parametrize("executor", ["picker", "panda"])
def test_two_layers_of_a_flat_tube_come_along_together(scene, arm, executor):
    """A flat skirt has a back under its front: caught together, much more of it lies elsewhere in the end."""
    positions = scene.cloth.positions
    hem = np.flatnonzero(positions[:, 1] < positions[:, 1].min() + 0.02)
    top = hem[np.lexsort((np.abs(positions[hem, 0]), -positions[hem, 2].round(3)))[0]]
    pick = positions[top] + LIFT
    place = pick + [0.0, 0.1, 0.1]

    def picked(grasp) -> np.ndarray:
        if executor == "picker":
            return by_picker(scene, pick, place, grasp, go).scene.cloth.positions
        return by_panda(scene, plan(arm, pick, place), grasp, go).scene.cloth.positions

    one, both = picked("good"), picked("two layers")
    moved = [(np.linalg.norm(after - positions, axis=1) > 0.02).sum() for after in (one, both)]
    assert moved[1] > 1.15 * moved[0]


def test_what_the_arm_refuses_changes_nothing(bench):
    bench.reset("flat")
    before, joints = bench.positions(), bench.simulator._world.arm.joints
    bench.told.clear()
    pick = corner(before)
    for number, (place, error, reason) in enumerate(
        [([1.0, 0, 0.1], OutOfReach, "place"), ([0.1, 0, 0.002], Refused, "would collide: .* of the table")]
    ):
        with pytest.raises(error, match=reason):
            bench.act(f"refused-{number}", pick, place, executor="panda")
    assert np.array_equal(bench.positions(), before)
    assert np.array_equal(bench.simulator._world.arm.joints, joints)
    assert bench.score().picks == 0
    assert "moving" not in [message.state for name, message in bench.told if name == "cell"]


def test_a_stop_leaves_the_arm_where_it_is_and_it_finds_its_way_back(bench):
    bench.reset("flat")
    start, place = corner(bench.positions()), np.array([-0.1, -0.1, 0.08])
    arm = bench.simulator._world.arm

    def stop_when_moving(topic, message):
        if topic.name == "cell" and message.state == "moving":
            bench.lessor.stop(EmergencyStop(reason="hand in the cell"))

    tell, bench.simulator._tell = bench.simulator._tell, stop_when_moving
    with pytest.raises(EmergencyStopped):
        bench.act("cut", start, place, executor="panda")
    assert np.linalg.norm(arm.tool[:2] - start[:2]) < 0.05  # it had come down to the cloth
    bench.simulator._tell = tell
    bench.lessor.clear_stop(ClearStop(operator="test"))
    outcome = bench.act("next", corner(bench.positions()), place, Call(), executor="panda")
    assert outcome.grasped
    assert outcome.arm_reached
    assert "arm:" in outcome.detail


def test_the_arm_follows_the_pull_frame_by_frame(arm):
    pick, place = np.array([0.0, 0.1, 0.02]), np.array([0.1, 0.0, 0.08])
    motion = plan(arm, pick, place)
    way = motion.poses.points[motion.holding]
    flown = pull(pick, place)
    nearest = np.linalg.norm(way[:, None] - flown, axis=2).min(axis=1)
    assert nearest.max() < np.linalg.norm(flown[1] - flown[0])
