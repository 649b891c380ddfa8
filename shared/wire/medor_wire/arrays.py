"""Arrays in messages: numpy arrays whose dtype, shape and finiteness are checked when a message is made.

`Annotated[Points, Shape("V 3", "f4")]` accepts any array of that rank, converts it to the dtype, and remembers
the size of every named dimension, so that two fields of one message that both say `V` must agree.
"""

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import GetCoreSchemaHandler
from pydantic_core import CoreSchema, core_schema


@dataclass(frozen=True)
class Shape:
    """Dimensions (names or sizes, separated by spaces; empty for a scalar) and numpy dtype of an array field."""

    dims: str
    dtype: str

    def check(self, value: ArrayLike) -> NDArray[Any]:
        """`value` as a read-only, contiguous array of this dtype.

        Raises:
            ValueError: wrong rank, wrong fixed size, not convertible without loss, or not finite.
        """
        given = np.asarray(value)
        if not np.can_cast(given.dtype, np.dtype(self.dtype), casting="same_kind"):
            raise ValueError(f"expected dtype {np.dtype(self.dtype)}, got {given.dtype}")
        array = np.ascontiguousarray(given, dtype=self.dtype).reshape(given.shape)
        if array.dtype.kind == "f" and not np.isfinite(array).all():
            bad = int(array.size - np.isfinite(array).sum())
            raise ValueError(f"expected finite values, got {bad} NaN or infinite of {array.size}")
        self.sizes(array)
        view = array.view()
        view.flags.writeable = False
        return view

    def sizes(self, array: NDArray[Any]) -> dict[str, int]:
        """Size of every named dimension."""
        dims = self.dims.split()
        if array.ndim != len(dims) or any(d.isdigit() and int(d) != n for d, n in zip(dims, array.shape, strict=False)):
            raise ValueError(f"expected shape ({', '.join(dims)}), got {array.shape}")
        return {d: n for d, n in zip(dims, array.shape, strict=True) if not d.isdigit()}

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(self.check)


Vector3 = Annotated[NDArray[np.float64], Shape("3", "f8")]
