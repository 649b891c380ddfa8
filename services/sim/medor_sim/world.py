"""The rigid world of the simulated cell: a table, a Panda arm beside it, a depth camera above it.

The cloth is not PyBullet's: it has its own solver, and the camera sees the cloth only (as in MEDOR's simulation).
"""

import pybullet
import pybullet_data
from pybullet_utils.bullet_client import BulletClient

from medor_cloth.camera import overhead
from medor_sim.arm import Arm

TABLE_HALF_SIZE_M = (0.4, 0.5, 0.02)
ARM_BASE_M = (-0.5, 0.0, 0.0)
"""From here the tool reaches every table point in view: they are 0.23 to 0.82 m away."""


class World:
    """One PyBullet world without a window. Task space: table plane z = 0, origin under the camera."""

    def __init__(self) -> None:
        self._client = BulletClient(pybullet.DIRECT)
        self._client.setAdditionalSearchPath(pybullet_data.getDataPath())
        table = self._add_table()
        panda = self._client.loadURDF("franka_panda/panda.urdf", ARM_BASE_M, useFixedBase=True)
        self.arm = Arm(self._client, panda, table, ARM_BASE_M)
        self.camera = overhead()

    def _add_table(self) -> int:
        shape = self._client.createCollisionShape(pybullet.GEOM_BOX, halfExtents=TABLE_HALF_SIZE_M)
        return self._client.createMultiBody(0, shape, basePosition=(0, 0, -TABLE_HALF_SIZE_M[2]))

    def close(self) -> None:
        self._client.disconnect()
