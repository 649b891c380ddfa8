"""Depth view in, cloth mesh out. Methods are named; a new one is a new entry in `Reconstructor.methods`."""

from collections.abc import Callable
from functools import partial

import numpy as np

from medor_cloth.camera import Camera
from medor_recon import whole
from medor_recon.methods import METHODS
from medor_recon.methods import Method as WholeMethod
from medor_recon.networks import Networks
from medor_recon.point_cloud import VOXEL_M, near, one_garment, voxel_nodes
from medor_recon.segment import segment
from medor_recon.stopwatch import Stopwatch
from medor_recon.surface import compact, surface
from medor_recon.viewpoint import viewpoint
from medor_recon.whole import Trust
from medor_wire.bus import Call
from medor_wire.errors import BadRequest, NoGarment, ReconstructionFailed
from medor_wire.messages import (
    Category,
    ClothMesh,
    DepthView,
    Reconstruction,
    ReconstructProgress,
    ReconstructRequest,
)

Method = Callable[[DepthView, Category, Stopwatch], ClothMesh]


class Reconstructor:
    """Answers `recon/reconstruct`.

    Args:
        min_height: of garment above the table [m] when no mask comes with the view.
        min_area: least visible area [m²] that counts as a garment.
        networks: trained ones; by default those that came with the package.
        trust: which completed meshes are refused.
    """

    def __init__(
        self,
        min_height: float = 0.002,
        min_area: float = 0.002,
        networks: Networks | None = None,
        trust: Trust | None = None,
    ) -> None:
        self.min_height = min_height
        self.min_area = min_area
        self._networks = networks or Networks()
        self._trust = trust or Trust()
        self.methods: dict[str, Method] = {"visible": self._visible}
        self.methods |= {name: partial(self._whole, method) for name, method in METHODS.items()}

    def reconstruct(self, request: ReconstructRequest, call: Call | None = None) -> Reconstruction:
        """The mesh of the garment in view; every stage is told as progress when it begins.

        Raises:
            BadRequest: unknown method, one without weights, or a camera that does not look at the table.
            NoGarment: nothing, or too little, that looks like cloth.
            SeveralGarments: two large things in view.
            ReconstructionFailed: seen, but what came out cannot be trusted.
            Cancelled, Timeout: the asker does not want the answer any more.
        """
        method = self.methods.get(request.method)
        if method is None:
            raise BadRequest(f"method: expected one of {sorted(self.methods)}, got {request.method!r}")
        call = call or Call()

        def tell(stage: str) -> None:
            call.check()
            call.progress(ReconstructProgress(stage=stage))

        stopwatch = Stopwatch(on_stage=tell)
        mesh = method(request.view, request.category, stopwatch)
        return Reconstruction(mesh=mesh, timings_ms=stopwatch.total())

    def _visible(self, view: DepthView, category: Category, stopwatch: Stopwatch) -> ClothMesh:
        """The visible points as cloth, nothing guessed about what they hide (MEDOR, baselines: VCD's input)."""
        camera = viewpoint(view.camera)
        depth, nodes = self._garment(view, camera, stopwatch)
        with stopwatch.stage("surface"):
            faces = surface(nodes, depth, camera, longest=2 * VOXEL_M, gap=0.25)
            if len(faces) == 0:
                raise ReconstructionFailed(f"{len(nodes)} visible nodes do not form a surface")
            vertices, faces = compact(nodes, faces)
        return ClothMesh(vertices=vertices, faces=faces, category=category, visible=np.ones(len(vertices), bool))

    def _whole(self, method: WholeMethod, view: DepthView, category: Category, stopwatch: Stopwatch) -> ClothMesh:
        """What is seen and what is hidden (MEDOR)."""
        camera = viewpoint(view.camera)
        depth, _ = self._garment(view, camera, stopwatch)
        return whole.reconstruct(method, category, depth, camera, self._networks, self._trust, stopwatch)

    def _garment(self, view: DepthView, camera: Camera, stopwatch: Stopwatch) -> tuple[np.ndarray, np.ndarray]:
        """Depth (H, W) [m] of the only garment in view, 0 elsewhere, and its nodes (V, 3) in a voxel grid."""
        with stopwatch.stage("segment"):
            points = camera.back_project(view.depth)
            garment = segment(points, view.mask, self.min_height)
            depth = np.where(garment, view.depth, 0).astype(np.float32)
            self._check_area(depth, camera)
        with stopwatch.stage("points"):
            nodes = voxel_nodes(points[garment])
            kept = one_garment(nodes)
            if len(kept) < len(nodes):
                depth[garment] *= near(points[garment], kept)
            return depth, kept

    def _check_area(self, depth: np.ndarray, camera: Camera) -> None:
        area = float((depth.astype(np.float64) ** 2).sum() / (camera.K[0, 0] * camera.K[1, 1]))
        if area < self.min_area:
            raise NoGarment(
                f"expected at least {self.min_area * 1e4:.0f} cm² of cloth in view, got {area * 1e4:.2f} cm²"
            )
