"""Of the simulated cell only."""

from typing import Literal

from pydantic import Field

from medor_wire.messages.base import Category, Message, StartState
from medor_wire.messages.cloth import ClothMesh


class ResetRequest(Message):
    category: Category = "tshirt"
    garment_seed: int = Field(default=1, ge=0, lt=2**31)
    garment_id: str | None = None
    """An uploaded garment; takes precedence over `garment_seed`."""
    state: StartState = "drop"
    seed: int = Field(default=0, ge=0, lt=2**31)


class Score(Message):
    """The referee's figures for the state on the table (simulator's truth; for reports, never for planning)."""

    coverage_m2: float
    flat_coverage_m2: float
    ni_flatten: float
    """Normalized improvement in coverage since the reset."""
    ni_canonicalize: float
    canonical_cost_m: float
    picks: int


class Truth(Message):
    """The true state of the simulated garment."""

    mesh: ClothMesh
    garment_id: str


class UploadGarment(Message):
    content: bytes = Field(max_length=64 << 20)
    file_type: Literal["obj", "ply", "glb"]
    category: Category


class GarmentId(Message):
    garment_id: str
    vertices: int
    faces: int
