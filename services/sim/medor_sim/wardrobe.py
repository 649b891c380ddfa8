"""Garments the simulated cell can lay on its table, each with what is computed of it once."""

import hashlib
import threading
from collections import OrderedDict
from functools import cached_property

import numpy as np

from medor_cloth.coverage import coverage
from medor_cloth.engine import Engine
from medor_cloth.errors import ClothError
from medor_cloth.garment import Garment, generate
from medor_cloth.goals import flattened, goal_set, solver_of
from medor_cloth.mesh_io import load_mesh
from medor_wire.errors import BadRequest, NotFound
from medor_wire.messages import Category


class Piece:
    """One garment, its solver, its flattened state and its goals."""

    def __init__(self, id: str, category: Category, garment: Garment) -> None:
        self.id = id
        self.category: Category = category
        self.garment = garment
        self.solver = solver_of(garment)

    @property
    def engine(self) -> Engine:
        """What moves it on the table."""
        return self.solver

    @cached_property
    def flat(self):
        """The flattened cloth at rest (`ClothState`)."""
        return flattened(self.garment, self.solver)

    @cached_property
    def flat_coverage(self) -> float:
        """Coverage of the flattened cloth [m²]: the best possible."""
        return coverage(self.flat.positions, self.garment.faces)

    @cached_property
    def goals(self) -> np.ndarray:
        """(S, V, 3) goal poses for canonicalization, world frame [m]."""
        return goal_set(self.garment, self.solver)


class Wardrobe:
    """Generated and uploaded garments, the latest `capacity` of each kind; older ones are forgotten."""

    def __init__(self, capacity: int = 8) -> None:
        self._capacity = capacity
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
                    self._keep(self._generated, Piece(id, category, generate(category, seed)))
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
            BadRequest: the file is not a mesh that can be cloth; says why.
        """
        id = f"{category}-{hashlib.sha256(category.encode() + content).hexdigest()[:12]}"
        try:
            piece = Piece(id, category, load_mesh(content, category, file_type))
        except ClothError as error:
            raise BadRequest(f"content: {error}") from error
        with self._lock:
            self._keep(self._uploaded, piece)
        return piece

    def _keep(self, shelf: OrderedDict[str, Piece], piece: Piece) -> None:
        shelf[piece.id] = piece
        while len(shelf) > self._capacity:
            shelf.popitem(last=False)
