"""The weights that come with the package, on garments and crumples that nothing was trained on."""

import numpy as np
import pytest
from scipy.spatial import KDTree

from medor_cloth.camera import overhead
from medor_cloth.coverage import coverage
from medor_cloth.garment import CATEGORIES, SYMMETRY_ORDER, Garment, generate
from medor_cloth.goals import solver_of
from medor_cloth.nocs import NOCS
from medor_cloth.raster import rasterize
from medor_cloth.start import dropped
from medor_recon.networks import SHIPPED, Networks
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


def turns(garment: Garment) -> list[np.ndarray]:
    """Rotations about the body axis that are forgiven."""
    count = max(SYMMETRY_ORDER[garment.category], 2)
    return [turn_about_z(2 * np.pi * k / count) for k in range(count)]


def misplaced(mesh: ClothMesh, garment: Garment, positions: np.ndarray) -> float:
    """Mean distance of the vertices, hidden ones included, from where they are said to be, the side forgiven; in units
    of what saying the middle of the garment of all of them would give."""
    assert mesh.canonical is not None
    said, true = KDTree(mesh.canonical), [garment.vertices @ turn.T for turn in turns(garment)]
    errors = [np.linalg.norm(mesh.vertices[said.query(each)[1]] - positions, axis=1).mean() for each in true]
    return float(min(errors) / np.linalg.norm(positions - positions.mean(axis=0), axis=1).mean())


def canonical_errors(
    said: np.ndarray, points: np.ndarray, garment: Garment, positions: np.ndarray
) -> tuple[float, float]:
    """Mean distance [m] of canonical coordinates from those of the true vertices nearest to the points they are said
    of, the side forgiven; and that of the best constant answer."""
    true = garment.vertices[KDTree(positions).query(points)[1]]
    constant = np.linalg.norm(true - true.mean(axis=0), axis=1).mean()
    return float(min(np.linalg.norm(said - true @ turn.T, axis=1).mean() for turn in turns(garment))), float(constant)


def flat(category: str) -> tuple[Garment, np.ndarray, DepthView]:
    garment = generate(category, SEED)
    positions = garment.laid_flat() @ turn_about_z(0.64).T
    return garment, positions, view_of(positions, garment.faces)


@pytest.mark.parametrize("category", CATEGORIES)
def test_the_pixels_of_a_garment_laid_flat_are_understood(category):
    garment, positions, view = flat(category)
    seen = Networks().canonicalizer("cpu", category).canonicalize(category, view.depth, overhead(720))
    error, constant = canonical_errors(NOCS[category].decode(seen.nocs), seen.points, garment, positions)
    assert error < 0.5 * constant


MERGED = pytest.mark.xfail(reason="finetuning lays the layers of a flat skirt into one: 0.8", strict=True)


@pytest.mark.parametrize(
    "category", [pytest.param(each, marks=MERGED) if each == "skirt" else each for each in CATEGORIES]
)
@pytest.mark.parametrize("method", ["medor", "isometric"])
def test_what_counts_as_visible_of_a_garment_laid_flat_is(reconstructor, category, method):
    garment, positions, view = flat(category)
    mesh = reconstructor.reconstruct(ReconstructRequest(view=view, category=category, method=method)).mesh
    error, constant = canonical_errors(mesh.canonical[mesh.visible], mesh.vertices[mesh.visible], garment, positions)
    assert error < 0.5 * constant


@pytest.mark.parametrize("category", CATEGORIES)
@pytest.mark.parametrize("method", ["medor", "isometric"])
def test_a_garment_laid_flat_comes_back_in_its_place(reconstructor, category, method):
    garment, positions, view = flat(category)
    mesh = reconstructor.reconstruct(ReconstructRequest(view=view, category=category, method=method)).mesh
    assert misplaced(mesh, garment, positions) < 0.25


@pytest.mark.parametrize("category", CATEGORIES)
@pytest.mark.parametrize("method", ["medor", "isometric"])
def test_crumpled_garments_come_back_whole(reconstructor, category, method):
    """Three of them: how one falls depends on the processor's last bits, and single views are misread."""
    wrong = []
    for seed in range(SEED, SEED + 3):
        garment, positions = crumpled(category, seed)
        seen = view_of(positions, garment.faces)
        mesh = reconstructor.reconstruct(ReconstructRequest(view=seen, category=category, method=method)).mesh
        assert 0.05 < mesh.visible.mean() < 0.95
        wrong.append(coverage(mesh.vertices, mesh.faces) / coverage(positions, garment.faces) - 1)
    assert abs(np.median(wrong)) < 0.3


def test_all_weights_together_stay_small():
    assert sum(file.stat().st_size for file in SHIPPED.rglob("*") if file.is_file()) < 60e6


def test_cards_say_how_the_weights_came_about():
    cards = list(SHIPPED.glob("*/card.md"))
    assert {card.parent for card in cards} == {each for each in SHIPPED.iterdir() if each.is_dir()}
    for card in cards:
        text = card.read_text()
        assert all(heading in text for heading in ("## command", "## data", "## metrics", "## revision"))
