"""What the camera sees."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from medor_wire.arrays import Shape
from medor_wire.messages.base import F4, F8, Bools, Message


class CameraInfo(Message):
    """A pinhole camera: intrinsics [px] and pose (OpenCV axes: x right, y down, z forward)."""

    K: Annotated[F8, Shape("3 3", "f8")]
    T_world_camera: Annotated[F8, Shape("4 4", "f8")]
    width: int = Field(gt=0, le=4096)
    height: int = Field(gt=0, le=4096)


class DepthView(Message):
    """One depth image. `depth` [m] is the distance along the optical axis, 0 where nothing was measured."""

    depth: Annotated[F4, Shape("H W", "f4")]
    camera: CameraInfo
    mask: Annotated[Bools, Shape("H W", "?")] | None = None
    """True on the garment; when absent it is segmented by height above the table."""
    stamp_ns: int = 0
    """Time of capture, nanoseconds since the epoch."""

    @model_validator(mode="after")
    def _camera_matches(self) -> Self:
        if self.depth.shape != (self.camera.height, self.camera.width):
            raise ValueError(
                f"depth is {self.depth.shape} but the camera says ({self.camera.height}, {self.camera.width})"
            )
        return self
