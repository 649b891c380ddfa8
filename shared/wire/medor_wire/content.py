"""Values compared by the arrays they are made of: keys for caches, such as `functools.lru_cache`."""

import hashlib
from dataclasses import dataclass, field
from typing import Any, Generic, Self, TypeVar

from numpy.typing import NDArray

Value = TypeVar("Value")


@dataclass(frozen=True)
class ByContent(Generic[Value]):
    """A value that equals another when the parts that matter of both are the same, byte for byte."""

    digest: bytes
    value: Value = field(compare=False)

    @classmethod
    def of(cls, value: Value, *parts: NDArray[Any] | str | None) -> Self:
        """`value`, compared by `parts`: arrays (dtype, shape and content), text or nothing."""
        digest = hashlib.sha256()
        for part in parts:
            if part is None or isinstance(part, str):
                digest.update(repr(part).encode())
            else:
                digest.update(f"{part.dtype.str}{part.shape}".encode())
                digest.update(part.tobytes())
        return cls(digest.digest(), value)
