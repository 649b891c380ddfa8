import json
import logging

import numpy as np
import pytest

from medor_cloth.camera import overhead
from medor_cloth.picture import png16_bytes
from medor_robot.driver import Driver
from medor_robot.dry_run import DryRunArm
from medor_robot.replay import ReplayCamera
from medor_robot.waypoints import CLEARANCE_M, waypoints
from medor_robot.workspace import PULL_S, Workspace
from medor_wire.bus import Call
from medor_wire.errors import BadRequest, EmergencyStopped, OutOfReach, Refused
from medor_wire.lease import Lessor
from medor_wire.ledger import Ledger
from medor_wire.messages import ActRequest, EmergencyStop, Empty, LeaseRequest
from medor_wire.motion import Motion

PICK, PLACE = np.array([0.05, 0.0, 0.02]), np.array([-0.05, 0.1, 0.1])


@pytest.fixture
def recording(tmp_path):
    camera = overhead(60)
    pose = {"K": camera.K.tolist(), "T_world_camera": camera.T_world_camera.tolist()}
    (tmp_path / "camera.json").write_text(json.dumps(pose))
    return tmp_path


@pytest.fixture
def lessor(tmp_path):
    ledger = Ledger(tmp_path / "ledger" / "ledger.sqlite")
    yield Lessor(ledger)
    ledger.close()


@pytest.fixture
def driver(tmp_path, lessor):
    motion = Motion(lessor._ledger, lessor)
    return Driver(motion, DryRunArm(), ReplayCamera(tmp_path), Workspace(), lambda topic, message: None)


def act(driver, lessor, pick=PICK, place=PLACE):
    epoch = lessor.lease(LeaseRequest(holder="test/1"), Call()).epoch
    return driver.act(ActRequest(action_id="a", epoch=epoch, pick=pick, place=place), Call())


def test_a_dry_run_says_that_nothing_moved_and_where_it_would_have_gone(driver, lessor, caplog):
    with caplog.at_level(logging.INFO, "medor_robot.dry_run"):
        outcome = act(driver, lessor)
    assert "nothing moves" in outcome.detail
    assert not outcome.grasped
    assert len(caplog.messages) == len(waypoints(PICK, PLACE))
    assert "dry run" in driver.status(Empty(), Call()).detail


def test_waypoints_are_the_straight_pull_with_a_way_in_and_out():
    stations = waypoints(PICK, PLACE)
    points = np.stack([s.point for s in stations])
    closed = np.array([s.closed for s in stations])
    assert points[0] == pytest.approx(PICK + [0, 0, CLEARANCE_M])
    assert points[-1] == pytest.approx(PLACE + [0, 0, CLEARANCE_M])
    pulled = points[closed]
    assert pulled[0] == pytest.approx(PICK)
    assert pulled[-1] == pytest.approx(PLACE)
    along = (pulled - PICK) @ (PLACE - PICK) / ((PLACE - PICK) @ (PLACE - PICK))
    assert pulled == pytest.approx(PICK + along[:, None] * (PLACE - PICK), abs=1e-6)
    assert (np.diff(along) > 0).all()
    assert not closed[[0, 1, -2, -1]].any()


@pytest.mark.parametrize(
    ("pick", "place", "error", "match"),
    [
        ([0.31, 0, 0.02], [0.2, 0, 0.1], OutOfReach, "pick"),
        ([0, 0, 0.0], [0.1, 0, 0.1], OutOfReach, "pick"),
        ([0, 0, 0.02], [0, -0.31, 0.1], OutOfReach, "place"),
        ([0, 0, 0.02], [0, 0, 0.41], OutOfReach, "place"),
        ([-0.25, 0, 0.02], [0.25, 0, 0.1], BadRequest, "m/s"),
        ([0, 0, np.inf], [0, 0, 0.1], ValueError, "finite"),
    ],
)
def test_limits_raise_and_never_clip(driver, lessor, pick, place, error, match):
    with pytest.raises(error, match=match):
        act(driver, lessor, np.array(pick), np.array(place))
    assert driver.status(Empty(), Call()).actions == 0


def test_the_workspace_box_includes_its_faces():
    box = Workspace(half_side=0.3, highest=0.4, lowest=0.002)
    corners = np.array([[0.3, 0.3, 0.4], [-0.3, 0.3, 0.002], [0.3, -0.3, 0.002]])
    assert box.contains(corners).all()
    assert not box.contains(corners * 1.001).any()
    box.check(np.zeros(3) + [0, 0, 0.01], np.array([box.top_speed * PULL_S * 0.999, 0, 0.01]))


def test_a_stop_ends_the_rehearsal_at_the_next_waypoint(driver, lessor, caplog):
    class StopAtThird(DryRunArm):
        def follow(self, stations, check):
            for number, _ in enumerate(stations):
                if number == 3:
                    lessor.stop(EmergencyStop(reason="third"))
                check()
            pytest.fail("it went on")

    driver._arm = StopAtThird()
    with pytest.raises(EmergencyStopped, match="third"):
        act(driver, lessor)


def test_replay_plays_a_folder_over_and_over(recording):
    rng = np.random.default_rng(0)
    depths = [rng.uniform(0.5, 0.65, (60, 60)).astype(np.float32) for _ in range(2)]
    np.savez(recording / "0001.npz", depth=depths[0], mask=depths[0] > 0.6)
    (recording / "0002.png").write_bytes(png16_bytes(depths[1]))
    camera = ReplayCamera(recording)
    first, second, third = (camera.capture() for _ in range(3))
    assert np.array_equal(first.depth, depths[0])
    assert first.mask is not None
    assert np.array_equal(first.mask, depths[0] > 0.6)
    assert np.abs(second.depth - depths[1]).max() <= 0.00005 + 1e-6
    assert second.mask is None
    assert np.array_equal(third.depth, first.depth)
    assert third.stamp_ns > first.stamp_ns
    assert first.camera.T_world_camera[2, 3] == pytest.approx(0.65)


def test_a_cell_without_recordings_starts_and_says_so(driver):
    assert "no recorded views" in driver.status(Empty(), Call()).detail
    with pytest.raises(Refused, match=r"camera\.json"):
        driver.capture(Empty(), Call())


def test_a_broken_recording_is_named(recording):
    (recording / "0001.npz").write_bytes(b"PK broken")
    with pytest.raises(Refused, match=r"0001\.npz"):
        ReplayCamera(recording).capture()
