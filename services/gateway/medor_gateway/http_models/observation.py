"""What the camera sees."""

from typing import Annotated

import numpy as np
from pydantic import Field

from medor_cloth.picture import PNG_UNIT_M
from medor_gateway.http_models.base import Command, Png, Quadruple, Triple, example
from medor_gateway.media import decode_depth, decode_mask, encode_depth, encode_mask
from medor_wire.messages import (
    CameraInfo,
    DepthView,
)


class Observation(Command):
    """One depth image and where it was taken. What `GET /cell/observation` answers, `POST /plan` accepts."""

    depth_png: Annotated[Png, Field(description="16-bit grey PNG; 0: nothing measured.")]
    depth_unit_m: Annotated[float, Field(gt=0, le=0.01, description="Metres per step of the PNG.")] = PNG_UNIT_M
    mask_png: Annotated[Png, Field(description="8-bit PNG, not 0 on the garment.")] | None = None
    K: Annotated[list[Triple], Field(min_length=3, max_length=3, description="Camera intrinsics [px], 3 x 3.")]
    T_world_camera: Annotated[
        list[Quadruple],
        Field(min_length=4, max_length=4, description="Camera pose, 4 x 4; x right, y down, z forward (OpenCV)."),
    ]
    stamp_s: Annotated[float, Field(ge=0, le=1e11, description="Time of capture since the epoch.")] = 0.0

    model_config = example(
        depth_png=encode_depth(np.full((8, 8), 0.65, np.float32)),
        K=[[9.66, 0.0, 4.0], [0.0, 9.66, 4.0], [0.0, 0.0, 1.0]],
        T_world_camera=[[1.0, 0, 0, 0], [0, -1.0, 0, 0], [0, 0, -1.0, 0.65], [0, 0, 0, 1.0]],
    )

    @classmethod
    def of(cls, view: DepthView) -> "Observation":
        return cls(
            depth_png=encode_depth(view.depth),
            mask_png=None if view.mask is None else encode_mask(view.mask),
            K=view.camera.K.tolist(),
            T_world_camera=view.camera.T_world_camera.tolist(),
            stamp_s=view.stamp_ns / 1e9,
        )

    def view(self) -> DepthView:
        """As a message.

        Raises:
            BadRequest: a PNG that is none, or of the wrong kind.
        """
        depth = decode_depth(self.depth_png, self.depth_unit_m)
        height, width = depth.shape
        camera = CameraInfo(
            K=np.array(self.K), T_world_camera=np.array(self.T_world_camera), width=width, height=height
        )
        mask = None if self.mask_png is None else decode_mask(self.mask_png)
        return DepthView(depth=depth, camera=camera, mask=mask, stamp_ns=round(self.stamp_s * 1e9))
