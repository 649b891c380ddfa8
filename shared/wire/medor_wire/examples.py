"""One valid request and reply of every endpoint and one content of every topic: for tests, docs and dry runs."""

from dataclasses import dataclass

import numpy as np

from medor_wire import endpoints as e
from medor_wire import messages as m
from medor_wire.endpoints import Endpoint, Topic
from medor_wire.messages import Message

IMAGE_PX = 64


@dataclass(frozen=True)
class Exchange:
    """A question that can be asked and an answer that could come back."""

    request: Message
    reply: Message
    progress: Message | None = None


def camera() -> m.CameraInfo:
    """The overhead camera, 0.65 m above the table, 45 degrees wide."""
    focal = IMAGE_PX / (2 * np.tan(np.radians(22.5)))
    K = np.array([[focal, 0, IMAGE_PX / 2], [0, focal, IMAGE_PX / 2], [0, 0, 1]])
    T_world_camera = np.array([[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 0.65], [0, 0, 0, 1.0]])
    return m.CameraInfo(K=K, T_world_camera=T_world_camera, width=IMAGE_PX, height=IMAGE_PX)


def view() -> m.DepthView:
    """A square cloth of 0.2 m, 5 mm thick, in the middle of an otherwise empty table."""
    depth = np.zeros((IMAGE_PX, IMAGE_PX), np.float32)
    half = round(0.1 / 0.65 * camera().K[0, 0])
    depth[IMAGE_PX // 2 - half : IMAGE_PX // 2 + half, IMAGE_PX // 2 - half : IMAGE_PX // 2 + half] = 0.645
    return m.DepthView(depth=depth, camera=camera(), mask=depth > 0, stamp_ns=1_700_000_000_000_000_000)


def mesh(side: int = 5) -> m.ClothMesh:
    """A flat square cloth of 0.2 m with `side`² vertices."""
    x, y = np.meshgrid(np.linspace(-0.1, 0.1, side), np.linspace(-0.1, 0.1, side))
    vertices = np.stack([x.ravel(), y.ravel(), np.full(side * side, 0.005)], axis=1).astype(np.float32)
    corner = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    lower = np.stack([corner, corner + 1, corner + side], axis=1)
    upper = np.stack([corner + 1, corner + side + 1, corner + side], axis=1)
    faces = np.concatenate([lower, upper]).astype(np.int32)
    canonical = vertices[:, [0, 2, 1]] * np.array([1, -1, 1], np.float32)
    return m.ClothMesh(
        vertices=vertices,
        faces=faces,
        category="tshirt",
        visible=np.ones(len(vertices), bool),
        canonical=canonical,
        panel_uv=vertices[faces][:, :, :2],
        confidence=np.full(len(vertices), 0.5, np.float32),
    )


PICK, PLACE = np.array([0.1, 0.1, 0.015]), np.array([0.2, 0.1, 0.05])
TOP = np.stack([PICK, PICK]).astype(np.float32)
SCORE = m.Score(
    coverage_m2=0.04, flat_coverage_m2=0.05, ni_flatten=0.5, ni_canonicalize=0.25, canonical_cost_m=0.03, picks=2
)
STATUS = m.CellStatus(
    cell="sim", state="idle", category="tshirt", holder="planner/1f2e3d4c", epoch=3, actions=2, camera=camera()
)
OUTCOME = m.ActOutcome(action_id="act-1", grasped=True, seconds=3.5)
PLANNING = m.PlanProgress(stage="rollout", fraction=0.5)


def plan() -> m.Plan:
    return m.Plan(
        plan_id="plan-1",
        category="tshirt",
        task="flatten",
        method="visible",
        no_op=False,
        pick=PICK,
        place=PLACE,
        reward=0.045,
        no_op_reward=0.04,
        mesh=mesh(),
        top_picks=TOP,
        top_places=TOP + np.float32(0.1),
        top_rewards=np.array([0.045, 0.043]),
        candidates=2,
        survivors=2,
        timings_ms={"reconstruct": 120.0, "rollout": 800.0},
    )


def episode_progress() -> m.EpisodeProgress:
    step = m.EpisodePick(
        index=1,
        pick=PICK,
        place=PLACE,
        reward=0.045,
        no_op_reward=0.04,
        coverage_m2=0.045,
        ni=0.5,
        timings_ms={"act": 3500.0},
        view=view(),
        plan=plan(),
    )
    return m.EpisodeProgress(step=step, planning=PLANNING)


def episode() -> m.Episode:
    start = m.EpisodePick(index=0, coverage_m2=0.04, ni=0.0)
    pick = m.EpisodePick(index=1, pick=PICK, place=PLACE, coverage_m2=0.049, ni=0.96)
    return m.Episode(ni=0.96, picks=(start, pick), flat_coverage_m2=0.05, reason="solved")


def _exchanges() -> dict[Endpoint, Exchange]:
    cloth = mesh()
    goals = np.stack([cloth.vertices, cloth.vertices])
    reward = m.Reward(task="canonicalize", goals=goals)
    assert cloth.canonical is not None
    flatten = m.FlattenRequest(category="tshirt", canonical=cloth.canonical, faces=cloth.faces, panel_uv=cloth.panel_uv)
    obj = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    return {
        e.RECONSTRUCT: Exchange(
            m.ReconstructRequest(view=view(), category="tshirt"),
            m.Reconstruction(mesh=cloth, timings_ms={"segment": 1.5, "mesh": 40.0}),
            m.ReconstructProgress(stage="mesh"),
        ),
        e.ROLLOUT: Exchange(
            m.RolloutRequest(mesh=cloth, picks=TOP, places=TOP, reward=reward),
            m.Rollouts(positions=goals, rewards=np.array([-0.01, -0.02]), seconds=0.8),
            m.RolloutProgress(done=1, total=2),
        ),
        e.FLATTEN: Exchange(flatten, m.GoalSet(goals=goals, flat_coverage_m2=0.05)),
        e.PLAN: Exchange(m.PlanRequest(category="tshirt", view=view(), candidates=2), plan(), PLANNING),
        e.EXECUTE: Exchange(m.ExecuteRequest(plan_id="plan-1"), OUTCOME),
        e.EPISODE: Exchange(m.EpisodeRequest(reset=m.ResetRequest()), episode(), episode_progress()),
        e.CAPTURE: Exchange(m.Empty(), view()),
        e.STATUS: Exchange(m.Empty(), STATUS),
        e.REACH: Exchange(m.ReachRequest(points=TOP, places=TOP), m.Reach(reachable=np.array([True, False]))),
        e.LEASE: Exchange(m.LeaseRequest(holder="planner/1f2e3d4c"), m.Lease(epoch=3, ttl_s=2.0)),
        e.ACT: Exchange(m.ActRequest(action_id="act-1", epoch=3, pick=PICK, place=PLACE), OUTCOME),
        e.CLEAR_STOP: Exchange(m.ClearStop(operator="ada"), STATUS),
        e.RESET: Exchange(m.ResetRequest(category="tshirt", garment_seed=7, state="drop", seed=1), SCORE),
        e.SCORE: Exchange(m.Empty(), SCORE),
        e.TRUTH: Exchange(m.Empty(), m.Truth(mesh=cloth, garment_id="tshirt-7")),
        e.UPLOAD_GARMENT: Exchange(
            m.UploadGarment(content=obj, file_type="obj", category="tshirt"),
            m.GarmentId(garment_id="upload-1", vertices=3, faces=1),
        ),
    }


def _contents() -> dict[Topic, Message]:
    return {
        e.DEPTH: view(),
        e.MESH: mesh(),
        e.CELL: STATUS,
        e.ACTION: OUTCOME,
        e.STOP: m.EmergencyStop(reason="hand in the cell", source="gateway"),
    }


EXCHANGES = _exchanges()
CONTENTS = _contents()
