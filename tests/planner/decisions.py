"""Decisions about a sheet, and the same ones elsewhere on the table."""

import numpy as np

from medor_planner.judge.situation import Foreseen, Situation
from medor_planner.sampling import Candidates
from medor_wire.messages import ClothMesh

COUNT = 12
"""Candidates of a decision."""


def turned(situation: Situation, heading: float, shift: tuple[float, float]) -> Situation:
    """The same decision elsewhere: table, cloth and camera together."""
    T = np.eye(4)
    T[:2, :2] = [[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]]
    T[:2, 3] = shift

    def move(points: np.ndarray) -> np.ndarray:
        return (points @ T[:3, :3].T + T[:3, 3]).astype(np.float32)

    def lying(mesh: ClothMesh) -> ClothMesh:
        return mesh.model_copy(update={"vertices": move(mesh.vertices)})

    info = situation.view.camera
    camera = info.model_copy(update={"T_world_camera": T @ info.T_world_camera})
    return Situation(
        situation.view.model_copy(update={"camera": camera}),
        lying(situation.mesh),
        Candidates(move(situation.candidates.picks), move(situation.candidates.places)),
        situation.goals.model_copy(update={"goals": move(situation.goals.goals)}),
        {name: Foreseen(lying(one.mesh), move(one.positions)) for name, one in situation.foreseen.items()},
    )
