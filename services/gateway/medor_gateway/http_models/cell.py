"""The cell: garments, crumples, scores, stops."""

from typing import Annotated, Literal

from pydantic import Field

from medor_gateway.http_models.base import Command, Report, Seed, Text, example
from medor_wire.messages import (
    Category,
    CellStatus,
    GarmentId,
    ResetRequest,
    Score,
    StartState,
)


class ResetCommand(Command):
    """Put a garment on the table of the simulated cell."""

    category: Category = "tshirt"
    garment_seed: Seed = 1
    garment_id: Annotated[Text, Field(max_length=128, description="An uploaded garment, instead of a seed.")] | None = (
        None
    )
    state: StartState = "drop"
    seed: Seed = 0

    model_config = example(category="tshirt", garment_seed=1, state="drop", seed=0)

    def message(self) -> ResetRequest:
        return ResetRequest.model_validate(self.model_dump())


class ScoreReport(Report):
    """The simulator's figures for the state on the table."""

    coverage_m2: float
    flat_coverage_m2: float
    ni_flatten: float
    ni_canonicalize: float
    canonical_cost_m: float
    picks: int

    @classmethod
    def of(cls, score: Score) -> "ScoreReport":
        return cls.model_validate(score.model_dump())


class GarmentReport(Report):
    """An uploaded garment."""

    garment_id: str
    vertices: int
    faces: int

    @classmethod
    def of(cls, garment: GarmentId) -> "GarmentReport":
        return cls.model_validate(garment.model_dump())


class CellReport(Report):
    """The state of the cell."""

    cell: Literal["sim", "robot"]
    state: Literal["idle", "moving", "stopped"] = Field(description="`stopped`: the e-stop is latched.")
    category: Category | None
    holder: str | None = Field(description="Who holds the lease of the robot.")
    epoch: int
    actions: int
    detail: str

    @classmethod
    def of(cls, status: CellStatus) -> "CellReport":
        return cls.model_validate(status.model_dump(exclude={"camera"}))


class StopCommand(Command):
    reason: Annotated[Text, Field(max_length=256)] = ""

    model_config = example(reason="a hand on the table")


class StopReport(Report):
    """The stop is on its way; `GET /cell/status` says when the cell has latched it."""

    sent: Literal[True] = True


class ClearCommand(Command):
    """An operator's word that it is safe to move again."""

    operator: Annotated[Text, Field(min_length=1, max_length=128)]

    model_config = example(operator="ada")
