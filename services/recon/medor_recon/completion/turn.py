"""Turning and mirroring a garment within its NOCS cube.

A canonicaliser learns up to the turns about the body axis that cannot be told apart in one view (`canonical.symmetry`).
What it gives for such a view is right for another garment: the same one, turned. Completion goes on with that one.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from medor_recon.canonical.symmetry import rotations


@dataclass(frozen=True, eq=False)
class Turn:
    """A turn, mirroring or both, about the cube's middle.

    Attributes:
        matrix: (3, 3) float32, orthogonal; z, the body axis, stays.
    """

    matrix: NDArray[np.float32]

    @property
    def mirrors(self) -> bool:
        """Whether left hands become right hands: faces have to be wound the other way."""
        return bool(np.linalg.det(self.matrix) < 0)

    @property
    def back(self) -> "Turn":
        """The way back."""
        return Turn(self.matrix.T)

    def __call__(self, nocs: NDArray[np.floating]) -> NDArray[np.float32]:
        """Turned coordinates (..., 3) in the cube."""
        return ((np.asarray(nocs, np.float32) - 0.5) @ self.matrix.T + 0.5).astype(np.float32)

    def wind(self, faces: NDArray[np.int32]) -> NDArray[np.int32]:
        """Faces (F, 3), wound outwards again."""
        return faces[:, ::-1] if self.mirrors else faces

    def then(self, other: "Turn") -> "Turn":
        """One after the other."""
        return Turn(other.matrix @ self.matrix)


NONE = Turn(np.eye(3, dtype=np.float32))
MIRRORED = Turn(np.diag([-1, 1, 1]).astype(np.float32))
"""Left and right exchanged."""


@cache
def turns(category: str) -> tuple[Turn, ...]:
    """What a view of a category may be taken for, the truth first."""
    return tuple(Turn(matrix) for matrix in rotations(category).numpy())


def winning(category: str, nocs: NDArray[np.floating], true: NDArray[np.floating]) -> Turn:
    """The turn of the true coordinates (P, 3) that the predicted ones (P, 3) are nearest to, on average."""
    errors = [np.linalg.norm(nocs - turn(true), axis=1).mean() for turn in turns(category)]
    return turns(category)[int(np.argmin(errors))]
