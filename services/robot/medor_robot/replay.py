"""A camera that plays recorded views back, for rehearsals without hardware."""

import itertools
import json
import threading
import time
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from medor_cloth.picture import depth_from_png16
from medor_wire.errors import Refused
from medor_wire.messages import CameraInfo, DepthView

CAMERA_FILE = "camera.json"
SUFFIXES = (".npz", ".png")


class ReplayCamera:
    """The views of a folder in the order of their names, over and over.

    The folder holds `camera.json` (K [px], T_world_camera [m]) and images: `.npz` with `depth` (H, W) [m] and, if
    known, `mask` (H, W) bool; or 16-bit grey `.png` in steps of 0.1 mm, as `GET /cell/observation` gives them.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._lock = threading.Lock()
        images = [path for path in folder.iterdir() if path.suffix in SUFFIXES] if folder.is_dir() else []
        self._turn = itertools.cycle(sorted(images))
        self.empty = not images

    @property
    def detail(self) -> str:
        return f"no recorded views in {self._folder}" if self.empty else f"replaying {self._folder}"

    def capture(self) -> DepthView:
        """The next view, stamped as taken now.

        Raises:
            Refused: there is no recording; or one that cannot be read, says why.
        """
        if self.empty:
            raise Refused(
                f"no camera: there is no recording to replay, expected images and camera.json in {self._folder}"
            )
        with self._lock:
            path = next(self._turn)
        try:
            return self._read(path)
        except (OSError, KeyError, ValueError, BadZipFile) as error:
            raise Refused(f"the recorded view {path} cannot be used: {error!r}") from error

    def _read(self, path: Path) -> DepthView:
        if path.suffix == ".npz":
            with np.load(path, allow_pickle=False) as arrays:
                depth, mask = arrays["depth"], arrays.get("mask")
        else:
            depth, mask = depth_from_png16(path.read_bytes()), None
        camera = json.loads((self._folder / CAMERA_FILE).read_text())
        height, width = depth.shape
        info = CameraInfo(K=camera["K"], T_world_camera=camera["T_world_camera"], width=width, height=height)
        return DepthView(depth=depth, mask=mask, camera=info, stamp_ns=time.time_ns())
