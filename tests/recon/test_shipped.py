"""The weights that come with the package, on garments and crumples that nothing was trained on."""

import numpy as np
import pytest
from scipy.spatial import KDTree

from medor_cloth.camera import overhead
from medor_cloth.coverage import coverage
from medor_cloth.garment import CATEGORIES, Garment, generate
from medor_cloth.goals import solver_of
from medor_cloth.raster import rasterize
from medor_cloth.start import dropped
from medor_recon.networks import SHIPPED
from medor_recon.reconstructor import Reconstructor
from medor_wire.messages import CameraInfo, ClothMesh, DepthView, ReconstructRequest

SEED = 860_001


@pytest.fixture(scope="module")
def reconstructor() -> Reconstructor:
    return Reconstructor()


def crumpled(category: str, seed: int) -> tuple[Garment, np.ndarray]:
    garment = generate(category, seed)
    solver = solver_of(garment)
    state = dropped(solver, solver.rest(garment.laid_flat()), np.random.default_rng(seed))
    return garment, state.positions


def view_of(positions: np.ndarray, faces: np.ndarray) -> DepthView:
    camera = overhead(720)
    raster = rasterize(positions, faces, camera)
    info = CameraInfo(K=camera.K, T_world_camera=camera.T_world_camera, width=720, height=720)
    return DepthView(depth=raster.depth, camera=info, mask=raster.mask)


def canonical_error(mesh: ClothMesh, garment: Garment, positions: np.ndarray) -> float:
    """Mean distance [m] in canonical space of what was seen, front and back forgiven."""
    assert mesh.canonical is not None
    _, vertex = KDTree(positions).query(mesh.vertices[mesh.visible])
    true, said = garment.vertices[vertex], mesh.canonical[mesh.visible]
    turned = true * np.array([-1, -1, 1], np.float32)
    return float(min(np.linalg.norm(said - each, axis=1).mean() for each in (true, turned)))


@pytest.mark.parametrize("category", CATEGORIES)
def test_a_crumpled_garment_comes_back_whole(reconstructor, category):
    """Whoever knew nothing of the view and put every point in the middle would be off by some 20 cm."""
    garment, positions = crumpled(category, SEED)
    seen = view_of(positions, garment.faces)
    mesh = reconstructor.reconstruct(ReconstructRequest(view=seen, category=category, method="isometric")).mesh
    assert 0.05 < mesh.visible.mean() < 0.95
    assert coverage(mesh.vertices, mesh.faces) == pytest.approx(coverage(positions, garment.faces), rel=0.3)
    assert canonical_error(mesh, garment, positions) < 0.12


def test_all_weights_together_stay_small():
    assert sum(file.stat().st_size for file in SHIPPED.rglob("*") if file.is_file()) < 60e6


def test_cards_say_how_the_weights_came_about():
    cards = list(SHIPPED.glob("*/card.md"))
    assert len(cards) == 2 * len(CATEGORIES)
    for card in cards:
        text = card.read_text()
        assert all(heading in text for heading in ("## command", "## data", "## metrics", "## revision"))
