"""A garment as PyBullet's soft body, at the settings that behaved best for about 500 vertices."""

from pathlib import Path

import numpy as np
import pybullet
from numpy.typing import NDArray

STEP_S = 0.0005
"""Time step [s]; at twice the step the cloth gains energy."""
REACH_M = 0.02
"""Vertices this close to the picker are fastened to it [m]."""


class SoftBody:
    """One garment on a table, without a window.

    Args:
        rest: Positions (V,3) [m] whose edge lengths are the rest lengths.
        faces: Triangles (F,3).
        mesh: Where to write them as an OBJ file, the only form PyBullet reads.
    """

    def __init__(self, rest: NDArray[np.float32], faces: NDArray[np.int32], mesh: Path):
        lines = [f"v {x} {y} {z}" for x, y, z in rest] + [f"f {a} {b} {c}" for a, b, c in faces + 1]
        mesh.write_text("\n".join(lines))
        self._client = pybullet.connect(pybullet.DIRECT)
        pybullet.resetSimulation(pybullet.RESET_USE_DEFORMABLE_WORLD, physicsClientId=self._client)
        pybullet.setGravity(0, 0, -9.81, physicsClientId=self._client)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=STEP_S, numSolverIterations=5, sparseSdfVoxelSize=0.05, physicsClientId=self._client
        )
        table = self._shape(pybullet.GEOM_BOX, halfExtents=[0.5, 0.5, 0.05])
        pybullet.createMultiBody(0, table, basePosition=[0, 0, -0.05], physicsClientId=self._client)
        self._cloth = pybullet.loadSoftBody(
            str(mesh),
            mass=0.1,
            useMassSpring=1,
            springElasticStiffness=40,
            springDampingStiffness=0.05,
            springDampingAllDirections=1,
            useBendingSprings=1,
            springBendingStiffness=0.05,
            useSelfCollision=1,
            collisionMargin=0.004,
            repulsionStiffness=50,
            frictionCoeff=0.5,
            physicsClientId=self._client,
        )
        pybullet.changeDynamics(
            self._cloth, -1, activationState=pybullet.ACTIVATION_STATE_DISABLE_SLEEPING, physicsClientId=self._client
        )

    def place(self, positions: NDArray[np.float32]) -> None:
        """Moves every vertex to a position (V,3) [m]; rest lengths stay."""
        pybullet.resetMeshData(self._cloth, positions.tolist(), physicsClientId=self._client)

    def pull(self, pick: NDArray[np.float32], velocity: NDArray[np.float32], duration_s: float) -> None:
        """Carries the vertices about `pick` (3,) [m] along at a velocity (3,) [m/s]."""
        picker = pybullet.createMultiBody(
            0, self._shape(pybullet.GEOM_SPHERE, radius=0.001), basePosition=pick.tolist()
        )
        held = np.flatnonzero(np.linalg.norm(self.positions() - pick, axis=1) < REACH_M)
        for vertex in held.tolist():
            pybullet.createSoftBodyAnchor(self._cloth, vertex, picker, -1, physicsClientId=self._client)
        for step in range(round(duration_s / STEP_S)):
            at = pick + velocity * (step + 1) * STEP_S
            pybullet.resetBasePositionAndOrientation(picker, at.tolist(), [0, 0, 0, 1], physicsClientId=self._client)
            pybullet.stepSimulation(physicsClientId=self._client)

    def positions(self) -> NDArray[np.float64]:
        """Vertex positions (V,3) [m], in the order of the mesh."""
        _, vertices = pybullet.getMeshData(
            self._cloth, -1, flags=pybullet.MESH_DATA_SIMULATION_MESH, physicsClientId=self._client
        )
        return np.array(vertices)

    def close(self) -> None:
        """Ends the simulation."""
        pybullet.disconnect(self._client)

    def _shape(self, kind: int, **size: object) -> int:
        return pybullet.createCollisionShape(kind, physicsClientId=self._client, **size)
