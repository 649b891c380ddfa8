import numpy as np
import pytest

from medor_cloth.coverage import coverage
from medor_recon.point_cloud import MIN_SPACING, VOXEL_M
from medor_recon.reconstructor import Reconstructor
from medor_wire.errors import BadRequest, NoGarment, SeveralGarments
from medor_wire.messages import CameraInfo, ClothMesh, DepthView, ReconstructRequest


def reconstruct(view: DepthView, method: str = "visible") -> ClothMesh:
    return Reconstructor().reconstruct(ReconstructRequest(view=view, category="tshirt", method=method)).mesh


def hill(x, y):
    return 0.005 + 0.05 * np.exp(-(x**2 + y**2) / 0.06**2)


def half_edges(faces):
    return faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)


def test_mesh_lies_on_the_observed_surface(view, sheet):
    mesh = reconstruct(view(sheet(height=hill)))
    x, y, z = mesh.vertices.T
    assert np.abs(z - hill(x, y)).max() < 0.004
    assert np.abs(np.stack([x, y])).max() <= 0.1


def test_mesh_is_an_oriented_manifold_that_looks_up(view, sheet):
    mesh = reconstruct(view(sheet(height=hill)))
    edges = half_edges(mesh.faces)
    assert len(np.unique(edges, axis=0)) == len(edges), "an edge runs twice in the same direction"
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()
    assert np.array_equal(np.unique(mesh.faces), np.arange(len(mesh.vertices)))
    assert mesh.visible.all()


def test_spacing_suits_the_cloth_solver(view, sheet):
    mesh = reconstruct(view(sheet(height=hill)))
    edges = half_edges(mesh.faces)
    lengths = np.linalg.norm(mesh.vertices[edges[:, 0]] - mesh.vertices[edges[:, 1]], axis=1)
    assert lengths.min() >= VOXEL_M * MIN_SPACING
    assert 0.015 < np.median(lengths) < 0.025
    assert lengths.max() < 2 * VOXEL_M


def test_mesh_covers_what_is_seen_up_to_half_a_voxel_at_the_rim(view, sheet):
    mesh = reconstruct(view(sheet()))
    assert (0.2 - VOXEL_M) ** 2 <= coverage(mesh.vertices, mesh.faces) <= 0.2**2


def test_reconstruction_follows_the_garment_across_the_table(view, sheet):
    shift = np.array([4 * VOXEL_M, -2 * VOXEL_M])
    here, there = (reconstruct(view(sheet(0.15, 0.15, centre=c))) for c in ((0, 0), tuple(shift)))
    moved = there.vertices[:, :2].mean(axis=0) - here.vertices[:, :2].mean(axis=0)
    assert moved == pytest.approx(shift, abs=0.002)


def test_without_a_mask_height_above_the_table_tells_the_garment(view, sheet):
    given = reconstruct(view(sheet()))
    found = reconstruct(view(sheet(), masked=False, table=True, noise=0.0005))
    assert coverage(found.vertices, found.faces) == pytest.approx(coverage(given.vertices, given.faces), rel=0.05)


def test_a_tall_fold_is_not_joined_to_the_table_layer(view, sheet):
    mesh = reconstruct(view(sheet(0.2, 0.2, height=0.003), sheet(0.08, 0.2, height=0.05)))
    heights = mesh.vertices[mesh.faces][..., 2]
    assert np.ptp(heights, axis=1).max() < 0.02
    assert {True, False} == set((heights.mean(axis=1) > 0.03).tolist())


def test_trouser_legs_stay_apart(view, sheet):
    legs = sheet(0.08, 0.2, centre=(-0.055, -0.05)), sheet(0.08, 0.2, centre=(0.055, -0.05))
    mesh = reconstruct(view(*legs, sheet(0.19, 0.08, centre=(0, 0.08))))
    below_crotch = mesh.vertices[mesh.faces][:, :, 1].max(axis=1) < 0.02
    x = mesh.vertices[mesh.faces[below_crotch]][..., 0]
    assert not ((x.min(axis=1) < 0) & (x.max(axis=1) > 0)).any()


def test_a_speck_beside_the_garment_is_ignored(view, sheet):
    speck = sheet(0.02, 0.02, centre=(0.2, 0.2))
    assert reconstruct(view(sheet(), speck)).vertices[:, 0].max() < 0.15


def test_timings_name_the_stages(view, sheet):
    reply = Reconstructor().reconstruct(ReconstructRequest(view=view(sheet()), category="dress", method="visible"))
    stages = {k: v for k, v in reply.timings_ms.items() if k != "total"}
    assert set(stages) == {"segment", "points", "surface"}
    assert 0 < sum(stages.values()) <= reply.timings_ms["total"]
    assert reply.mesh.category == "dress"


def test_same_view_same_mesh(view, sheet):
    first, second = (reconstruct(view(sheet(height=hill))) for _ in range(2))
    assert np.array_equal(first.vertices, second.vertices)
    assert np.array_equal(first.faces, second.faces)


def test_an_empty_table_has_no_garment(view, sheet):
    flat_on_table = sheet(0.4, 0.4, height=0.0)
    with pytest.raises(NoGarment, match="2 mm above"):
        reconstruct(view(flat_on_table, masked=False, table=True))
    blank = view(sheet())
    with pytest.raises(NoGarment, match="mask"):
        reconstruct(blank.model_copy(update={"mask": np.zeros_like(blank.mask)}))


def test_a_scrap_is_no_garment(view, sheet):
    with pytest.raises(NoGarment, match="cm²"):
        reconstruct(view(sheet(0.03, 0.03)))


def test_two_garments_are_refused(view, sheet):
    with pytest.raises(SeveralGarments, match="got 2"):
        reconstruct(view(sheet(0.1, 0.1, centre=(-0.15, 0)), sheet(0.1, 0.1, centre=(0.15, 0))))


def test_unknown_method_is_refused(view, sheet):
    with pytest.raises(BadRequest, match="visible"):
        reconstruct(view(sheet()), method="psychic")


@pytest.mark.parametrize(
    ("change", "match"),
    [
        (lambda K, T: T.__setitem__((2, 2), 1.0) or T.__setitem__((1, 1), 1.0), "straight down"),
        (lambda K, T: T.__setitem__((2, 3), -0.65), "straight down"),
        (lambda K, T: T.__setitem__((0, 0), 2.0), "rotation"),
        (lambda K, T: K.__setitem__((0, 0), 0.0), "focal"),
    ],
    ids=["looks up", "below the table", "not rigid", "no focal length"],
)
def test_a_camera_that_cannot_see_the_table_is_refused(view, sheet, change, match):
    seen = view(sheet())
    K, T = seen.camera.K.copy(), seen.camera.T_world_camera.copy()
    change(K, T)
    camera = CameraInfo(K=K, T_world_camera=T, width=seen.camera.width, height=seen.camera.height)
    with pytest.raises(BadRequest, match=match):
        reconstruct(DepthView(depth=seen.depth, mask=seen.mask, camera=camera))


def test_depth_in_millimetres_is_recognised(view, sheet):
    seen = view(sheet())
    with pytest.raises(BadRequest, match="metres"):
        reconstruct(DepthView(depth=seen.depth * 1000, mask=seen.mask, camera=seen.camera))


def test_malformed_views_cannot_be_made(view, sheet):
    seen = view(sheet())
    broken = seen.depth.copy()
    broken[5, 5] = np.nan
    with pytest.raises(ValueError, match="1 NaN"):
        DepthView(depth=broken, camera=seen.camera)
    with pytest.raises(ValueError, match="shape"):
        DepthView(depth=seen.depth[None], camera=seen.camera)
    with pytest.raises(ValueError, match="camera says"):
        DepthView(depth=seen.depth[:-1], camera=seen.camera)
    with pytest.raises(ValueError, match="dimension"):
        DepthView(depth=seen.depth, mask=seen.mask[:-1], camera=seen.camera)
    with pytest.raises(ValueError, match="camera"):
        DepthView.model_validate({"depth": seen.depth})
