"""What moves a cloth: our solver, or another physics in its place."""

from typing import Protocol

from numpy.typing import ArrayLike

from medor_cloth.cloth import Cloth
from medor_cloth.solver import ClothState


class Engine(Protocol):
    """Physics of one cloth on the table z = 0. States are values: a call makes a new one and keeps the old as it was.

    `medor_cloth.solver.Solver` is one. What a state holds beyond its positions may be less exact elsewhere: an engine
    need restore no velocities unless it goes on from the state it returned last.
    """

    @property
    def cloth(self) -> Cloth:
        """Topology and rest shape."""
        ...

    def rest(self, positions: ArrayLike) -> ClothState:
        """The cloth at the given positions (V,3) [m], not moving, the picker parked."""
        ...

    def placed(self, state: ClothState, picker: ArrayLike) -> ClothState:
        """The same state with an empty picker at another place (3,) [m]."""
        ...

    def advance(
        self,
        state: ClothState,
        frames: int,
        *,
        picker_path: ArrayLike | None = None,
        holding: ArrayLike | None = None,
        settle_speed: float | None = None,
    ) -> ClothState:
        """The cloth at most some frames of 0.01 s later; see `medor_cloth.solver.Solver.advance`."""
        ...
