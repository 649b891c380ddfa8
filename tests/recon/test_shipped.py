"""The weights that come with the package, on garments and crumples that nothing was trained on."""

import numpy as np
import pytest
from scipy.spatial import KDTree

from medor_cloth.camera import overhead
from medor_cloth.coverage import coverage
from medor_cloth.garment import CATEGORIES, SYMMETRY_ORDER, Garment, generate
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


def turn_about_z(angle: float) -> np.ndarray:
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]], np.float32)


def misplaced(mesh: ClothMesh, garment: Garment, positions: np.ndarray) -> float:
    """Mean distance of the vertices, hidden ones included, from where they are said to be, the side forgiven; in units
    of what saying the middle of the garment of all of them would give."""
    assert mesh.canonical is not None
    said, turns = KDTree(mesh.canonical), max(SYMMETRY_ORDER[garment.category], 2)
    turned = [garment.vertices @ turn_about_z(2 * np.pi * k / turns).T for k in range(turns)]
    errors = [np.linalg.norm(mesh.vertices[said.query(each)[1]] - positions, axis=1).mean() for each in turned]
    return float(min(errors) / np.linalg.norm(positions - positions.mean(axis=0), axis=1).mean())


@pytest.mark.parametrize("category", CATEGORIES)
def test_a_garment_laid_flat_is_understood(reconstructor, category):
    garment = generate(category, SEED)
    positions = garment.laid_flat() @ turn_about_z(0.64).T
    seen = view_of(positions, garment.faces)
    mesh = reconstructor.reconstruct(ReconstructRequest(view=seen, category=category, method="isometric")).mesh
    assert misplaced(mesh, garment, positions) < 0.25


@pytest.mark.parametrize("category", CATEGORIES)
def test_a_crumpled_garment_comes_back_whole(reconstructor, category):
    garment, positions = crumpled(category, SEED)
    seen = view_of(positions, garment.faces)
    mesh = reconstructor.reconstruct(ReconstructRequest(view=seen, category=category, method="isometric")).mesh
    assert 0.05 < mesh.visible.mean() < 0.95
    assert coverage(mesh.vertices, mesh.faces) == pytest.approx(coverage(positions, garment.faces), rel=0.3)


def test_all_weights_together_stay_small():
    assert sum(file.stat().st_size for file in SHIPPED.rglob("*") if file.is_file()) < 60e6


def test_cards_say_how_the_weights_came_about():
    cards = list(SHIPPED.glob("*/card.md"))
    assert {card.parent for card in cards} == {each for each in SHIPPED.iterdir() if each.is_dir()}
    for card in cards:
        text = card.read_text()
        assert all(heading in text for heading in ("## command", "## data", "## metrics", "## revision"))
