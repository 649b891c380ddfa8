"""What all requests and answers have in common.

Requests are strict: unknown fields and silent conversions are refused.
"""

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, FiniteFloat

from medor_wire.messages import (
    F4,
    F8,
    Executor,
)


def _unicode(text: str) -> str:
    try:
        text.encode()
    except UnicodeEncodeError as error:
        raise ValueError("expected valid Unicode") from error
    return text


Text = Annotated[str, AfterValidator(_unicode)]
Seed = Annotated[int, Field(ge=0, lt=2**31, description="The same seed gives the same result.")]
MethodName = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_+-]{0,63}$", description="A named planner preset.")]
ExecutorName = Annotated[
    Executor, Field(description="Simulated cell only: the flying gripper of the paper, or the Panda arm.")
]
EndReason = Literal["solved", "max_picks", "no_op"]
Triple = Annotated[list[FiniteFloat], Field(min_length=3, max_length=3)]
Point = tuple[float, float, float]
Quadruple = Annotated[list[FiniteFloat], Field(min_length=4, max_length=4)]
Png = Annotated[
    str,
    Field(max_length=48 << 20, json_schema_extra={"contentEncoding": "base64", "contentMediaType": "image/png"}),
]


class Command(BaseModel):
    """Base of what is sent to the door."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


class Report(BaseModel):
    """Base of what the door answers. Messages may have more to say."""

    model_config = ConfigDict(frozen=True, extra="ignore")


def example(**values: Any) -> ConfigDict:
    return ConfigDict(json_schema_extra={"examples": [values]})


def point(xyz: F4 | F8) -> Point:
    """An array of three as a JSON list."""
    x, y, z = xyz.tolist()
    return x, y, z
