"""Depth view in, cloth mesh out. Methods are named; a new one is a new entry in `Reconstructor.methods`."""

import time
from collections.abc import Callable
from contextlib import contextmanager

import numpy as np

from medor_cloth.camera import Camera
from medor_recon.point_cloud import VOXEL_M, one_garment, voxel_nodes
from medor_recon.segment import segment
from medor_recon.surface import compact, surface
from medor_recon.viewpoint import viewpoint
from medor_wire.errors import BadRequest, NoGarment, ReconstructionFailed
from medor_wire.messages import Category, ClothMesh, DepthView, Reconstruction, ReconstructRequest

Method = Callable[[DepthView, Category, "Stopwatch"], ClothMesh]


class Stopwatch:
    """Milliseconds spent in named stages."""

    def __init__(self) -> None:
        self.timings_ms: dict[str, float] = {}

    @contextmanager
    def stage(self, name: str):
        start = time.perf_counter()
        yield
        self.timings_ms[name] = (time.perf_counter() - start) * 1e3


class Reconstructor:
    """Answers `recon/reconstruct`.

    Args:
        min_height: of garment above the table [m] when no mask comes with the view.
        min_area: least visible area [m²] that counts as a garment.
    """

    def __init__(self, min_height: float = 0.002, min_area: float = 0.002) -> None:
        self.min_height = min_height
        self.min_area = min_area
        self.methods: dict[str, Method] = {"visible": self._visible}

    def reconstruct(self, request: ReconstructRequest, call: object = None) -> Reconstruction:
        """The mesh of the garment in view.

        Raises:
            BadRequest: unknown method, or a camera that does not look at the table.
            NoGarment: nothing, or too little, that looks like cloth.
            SeveralGarments: two large things in view.
            ReconstructionFailed: seen, but its points do not form a surface.
        """
        method = self.methods.get(request.method)
        if method is None:
            raise BadRequest(f"method: expected one of {sorted(self.methods)}, got {request.method!r}")
        stopwatch = Stopwatch()
        with stopwatch.stage("total"):
            mesh = method(request.view, request.category, stopwatch)
        return Reconstruction(mesh=mesh, timings_ms=stopwatch.timings_ms)

    def _visible(self, view: DepthView, category: Category, stopwatch: Stopwatch) -> ClothMesh:
        """The visible points as cloth, nothing guessed about what they hide (MEDOR, baselines: VCD's input)."""
        camera = viewpoint(view.camera)
        with stopwatch.stage("segment"):
            points = camera.back_project(view.depth)
            garment = segment(points, view.mask, self.min_height)
            depth = np.where(garment, view.depth, 0)
            self._check_area(depth, camera)
        with stopwatch.stage("points"):
            nodes = one_garment(voxel_nodes(points[garment]))
        with stopwatch.stage("surface"):
            faces = surface(nodes, depth, camera, longest=2 * VOXEL_M, gap=0.25)
            if len(faces) == 0:
                raise ReconstructionFailed(f"{len(nodes)} visible nodes do not form a surface")
            vertices, faces = compact(nodes, faces)
        return ClothMesh(vertices=vertices, faces=faces, category=category, visible=np.ones(len(vertices), bool))

    def _check_area(self, depth: np.ndarray, camera: Camera) -> None:
        area = float((depth.astype(np.float64) ** 2).sum() / (camera.K[0, 0] * camera.K[1, 1]))
        if area < self.min_area:
            raise NoGarment(
                f"expected at least {self.min_area * 1e4:.0f} cm² of cloth in view, got {area * 1e4:.2f} cm²"
            )
