"""Garments the simulated cell can lay on its table, each with what is computed of it once."""

import hashlib
import threading
from collections import OrderedDict
from functools import cached_property
from typing import Literal

import numpy as np

from medor_cloth.coverage import coverage
from medor_cloth.engine import Engine
from medor_cloth.errors import ClothError
from medor_cloth.garment import Garment, generate
from medor_cloth.goals import flattened, goal_set, solver_of
from medor_cloth.mesh_io import load_mesh
from medor_cloth.solver import ClothState, SolverConfig
from medor_sim.bullet_cloth import EDGE_M as BULLET_EDGE_M
from medor_sim.bullet_cloth import BulletCloth
from medor_sim.soft_body import MARGIN_M
from medor_wire.errors import BadRequest, NotFound
from medor_wire.messages import Category

EngineName = Literal["xpbd", "bullet"]
"""Our solver, or PyBullet's soft body in its place."""
EDGE_M: dict[EngineName, float] = {"xpbd": 0.012, "bullet": BULLET_EDGE_M}
"""Mean edge length of the garments generated for an engine [m]."""
MAX_START_COVERAGE: dict[EngineName, float] = {"xpbd": 0.7, "bullet": 0.85}
"""Largest coverage of a dropped garment, as a share of the flat one. PyBullet's is thick and viscous."""


class Piece:
    """One garment, what moves it on the table, its flattened state and its goals.

    Flat state and goals come from our solver whatever the engine, on the same mesh, so that figures mean the same.
    """

    def __init__(
        self,
        id: str,
        category: Category,
        garment: Garment,
        engine: EngineName = "xpbd",
        config: SolverConfig | None = None,
    ) -> None:
        self.id = id
        self.category: Category = category
        self.garment = garment
        self.solver = solver_of(garment, config)
        self.engine: Engine = self.solver if engine == "xpbd" else BulletCloth(garment, self.solver.cloth)
        self.max_start_coverage = MAX_START_COVERAGE[engine]
        self._thickness = 1.0 if engine == "xpbd" else 2 * MARGIN_M / self.solver.config.thickness

    @cached_property
    def flat(self) -> ClothState:
        """The flattened cloth at rest."""
        return self.engine.rest(self._as_thick(flattened(self.garment, self.solver).positions))

    @cached_property
    def flat_coverage(self) -> float:
        """Coverage of the flattened cloth [m²]: the best possible."""
        return coverage(self.flat.positions, self.garment.faces)

    @cached_property
    def goals(self) -> np.ndarray:
        """(S, V, 3) goal poses for canonicalization, world frame [m]."""
        return self._as_thick(goal_set(self.garment, self.solver))

    def _as_thick(self, positions: np.ndarray) -> np.ndarray:
        """Flat poses (…, V, 3) [m] with layers as far apart as the engine keeps them."""
        return positions * np.array([1, 1, self._thickness], np.float32)


class Wardrobe:
    """Generated and uploaded garments, the latest `capacity` of each kind; older ones are forgotten."""

    def __init__(self, capacity: int = 8, engine: EngineName = "xpbd", config: SolverConfig | None = None) -> None:
        self._capacity = capacity
        self._config = config
        self._engine: EngineName = engine
        self._generated: OrderedDict[str, Piece] = OrderedDict()
        self._uploaded: OrderedDict[str, Piece] = OrderedDict()
        self._lock = threading.Lock()

    def generated(self, category: Category, seed: int) -> Piece:
        """The garment of a seed.

        Raises:
            BadRequest: no valid garment for this seed.
        """
        id = f"{category}-{seed}"
        with self._lock:
            if id not in self._generated:
                try:
                    garment = generate(category, seed, EDGE_M[self._engine])
                    self._keep(self._generated, Piece(id, category, garment, self._engine, self._config))
                except ClothError as error:
                    raise BadRequest(f"garment_seed: {error}") from error
            self._generated.move_to_end(id)
            return self._generated[id]

    def uploaded(self, id: str) -> Piece:
        """An uploaded garment.

        Raises:
            NotFound: never uploaded, or forgotten since.
        """
        with self._lock:
            if id not in self._uploaded:
                raise NotFound(f"garment_id: {id!r} is not among the last {self._capacity} uploaded garments")
            self._uploaded.move_to_end(id)
            return self._uploaded[id]

    def add(self, content: bytes, file_type: str, category: Category) -> Piece:
        """Take in a user's mesh; the same content and category again is the same garment.

        Raises:
            BadRequest: the file is not a mesh that can be cloth, or not this engine's; says why.
        """
        id = f"{category}-{hashlib.sha256(category.encode() + content).hexdigest()[:12]}"
        try:
            piece = Piece(id, category, load_mesh(content, category, file_type), self._engine, self._config)
        except ClothError as error:
            raise BadRequest(f"content: {error}") from error
        with self._lock:
            self._keep(self._uploaded, piece)
        return piece

    def _keep(self, shelf: OrderedDict[str, Piece], piece: Piece) -> None:
        shelf[piece.id] = piece
        while len(shelf) > self._capacity:
            shelf.popitem(last=False)
