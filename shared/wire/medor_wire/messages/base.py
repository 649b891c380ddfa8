"""What all messages have in common: frozen, typed, shape-checked."""

from functools import cache
from typing import ClassVar, Literal, Self, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, model_validator

from medor_wire.arrays import Shape

Category = Literal["trousers", "tshirt", "dress", "skirt", "jumpsuit"]
Task = Literal["flatten", "canonicalize"]
StartState = Literal["drop", "flat", "picks"]
Executor = Literal["picker", "panda"]
"""Who carries a pick-and-place out in the simulated cell: the flying gripper or the arm. A real cell has its arm."""

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]
I4 = NDArray[np.int32]
Bools = NDArray[np.bool_]


class Message(BaseModel):
    """Base of all messages. Unknown fields are ignored, so that a newer peer may add optional ones."""

    model_config = ConfigDict(frozen=True, extra="ignore", arbitrary_types_allowed=True)
    VERSION: ClassVar[int] = 1
    """Major version; a peer refuses a frame of another one."""

    @model_validator(mode="after")
    def _dimensions_agree(self) -> Self:
        sizes: dict[str, tuple[int, str]] = {}
        for name, shape in array_fields(type(self)).items():
            value = getattr(self, name)
            for dim, size in shape.sizes(value).items() if value is not None else ():
                seen, where = sizes.setdefault(dim, (size, name))
                if seen != size:
                    raise ValueError(f"dimension {dim} is {seen} in {where} but {size} in {name}")
        return self

    def __eq__(self, other: object) -> bool:
        if type(self) is not type(other):
            return NotImplemented
        return all(_same(getattr(self, name), getattr(other, name)) for name in type(self).model_fields)


def _same(one: object, other: object) -> bool:
    if isinstance(one, np.ndarray) or isinstance(other, np.ndarray):
        return np.array_equal(one, other)  # type: ignore[arg-type]
    return one == other


@cache
def array_fields(message: type[Message]) -> dict[str, Shape]:
    """The shape of every array field, optional ones included."""
    found: dict[str, Shape] = {}
    for name, field in message.model_fields.items():
        parts = [*field.metadata, *(x for arg in get_args(field.annotation) for x in get_args(arg))]
        for shape in (part for part in parts if isinstance(part, Shape)):
            found[name] = shape
    return found


class Empty(Message):
    """No content."""
