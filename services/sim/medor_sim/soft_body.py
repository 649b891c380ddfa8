"""One garment as PyBullet's soft body on a table, in a world of its own."""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pybullet
from numpy.typing import ArrayLike, NDArray
from pybullet_utils.bullet_client import BulletClient

from medor_cloth.integration import FRAME_S

STEP_S = 0.0005
"""Time step [s]; at twice the step the cloth gains energy."""
MARGIN_M = 0.004
"""Height of a lying layer over the table, half the distance between two layers [m]. The default, 0.02, is useless."""
TABLE_HALF_SIZE_M = (0.5, 0.5, 0.05)
TABLE_FRICTION = 3.0
"""Times the cloth's own 0.5. With PyBullet's 0.5, cloth drifts over the table: layers in contact push it about."""
CLOTH = {
    "mass": 0.1,
    "useMassSpring": 1,
    "springElasticStiffness": 40,
    "springDampingStiffness": 0.02,
    "springDampingAllDirections": 1,
    "useBendingSprings": 1,
    "springBendingStiffness": 0.01,
    "useSelfCollision": 1,
    "collisionMargin": MARGIN_M,
    "repulsionStiffness": 20,
    "frictionCoeff": 0.5,
}
"""What behaves best at about 500 vertices; at 1000 the cloth gains energy."""
WORLD = {"fixedTimeStep": STEP_S, "numSolverIterations": 5, "sparseSdfVoxelSize": 0.05}
_STEPS = round(FRAME_S / STEP_S)


class SoftBody:
    """A cloth at rest, and at most one vertex of it held.

    PyBullet can move a cloth but not stop it, so every state that is to be at rest gets a body of its own.

    Args:
        rest: Positions (V,3) [m] whose edge lengths are the rest lengths.
        faces: Triangles (F,3).
        positions: Where the cloth is (V,3) [m].
    """

    def __init__(self, rest: NDArray[np.float32], faces: NDArray[np.int32], positions: NDArray[np.float32]):
        client = self._client = BulletClient(pybullet.DIRECT)
        client.resetSimulation(pybullet.RESET_USE_DEFORMABLE_WORLD)
        client.setGravity(0, 0, -9.81)
        client.setPhysicsEngineParameter(**WORLD)
        # A plane has no distance field to lie on: the cloth would float 0.1 m above it.
        table = client.createCollisionShape(pybullet.GEOM_BOX, halfExtents=TABLE_HALF_SIZE_M)
        top = client.createMultiBody(0, table, basePosition=(0, 0, -TABLE_HALF_SIZE_M[2]))
        client.changeDynamics(top, -1, lateralFriction=TABLE_FRICTION)
        with TemporaryDirectory() as folder:
            mesh = Path(folder) / "cloth.obj"
            mesh.write_text(_obj(rest, faces))
            self._cloth = client.loadSoftBody(str(mesh), **CLOTH)
        client.changeDynamics(self._cloth, -1, activationState=pybullet.ACTIVATION_STATE_DISABLE_SLEEPING)
        self.move_to(positions)
        self._picker, self._anchor, self._at = client.createMultiBody(0), -1, np.zeros(3)

    def positions(self) -> NDArray[np.float32]:
        """Where the vertices are (V,3) [m], in the order of the mesh."""
        flags = pybullet.MESH_DATA_SIMULATION_MESH
        return np.array(self._client.getMeshData(self._cloth, -1, flags=flags)[1], np.float32)

    def move_to(self, positions: NDArray[np.float32]) -> None:
        """Put every vertex at a position (V,3) [m]; it moves on from there as fast as it did."""
        self._client.resetMeshData(self._cloth, np.asarray(positions).tolist())

    def hold(self, vertex: int) -> None:
        """Fasten a vertex to the picker."""
        self._move_picker(self.positions()[vertex].astype(np.float64))
        self._anchor = self._client.createSoftBodyAnchor(self._cloth, vertex, self._picker, -1)

    def release(self) -> None:
        """Let go of the held vertex, if any."""
        if self._anchor >= 0:
            self._client.removeConstraint(self._anchor)
            self._anchor = -1

    def step(self, move: ArrayLike = (0, 0, 0)) -> None:
        """One frame of 0.01 s, in which the held vertex moves by (3,) [m], but not into the table."""
        start = self._at
        end = start + np.asarray(move, np.float64)
        end[2] = max(end[2], min(MARGIN_M, start[2]))
        for share in np.arange(1, _STEPS + 1) / _STEPS:
            if self._anchor >= 0:
                self._move_picker(start + share * (end - start))
            self._client.stepSimulation()

    def close(self) -> None:
        """End the world."""
        self._client.disconnect()

    def _move_picker(self, at: NDArray[np.float64]) -> None:
        self._at = at
        self._client.resetBasePositionAndOrientation(self._picker, at.tolist(), (0, 0, 0, 1))


def _obj(vertices: NDArray[np.float32], faces: NDArray[np.int32]) -> str:
    lines = [f"v {x} {y} {z}" for x, y, z in vertices] + [f"f {a} {b} {c}" for a, b, c in faces + 1]
    return "\n".join(lines)
