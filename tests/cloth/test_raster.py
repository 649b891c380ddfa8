import numpy as np
import pytest

from medor_cloth.camera import Camera, overhead
from medor_cloth.raster import rasterize, visible_vertices


def grid(n: int, side: float, height) -> tuple[np.ndarray, np.ndarray]:
    """A square sheet of n x n vertices; height(x, y) gives z."""
    x, y = np.meshgrid(np.linspace(-side / 2, side / 2, n), np.linspace(-side / 2, side / 2, n))
    vertices = np.stack([x, y, height(x, y)], axis=-1).reshape(-1, 3).astype(np.float32)
    i = np.arange(n * n).reshape(n, n)
    a, b, c, d = i[:-1, :-1].ravel(), i[:-1, 1:].ravel(), i[1:, :-1].ravel(), i[1:, 1:].ravel()
    return vertices, np.concatenate([np.stack([a, b, c], 1), np.stack([b, d, c], 1)]).astype(np.int32)


def crumple(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """A sheet that folds over itself, all above the table."""
    rng = np.random.default_rng(seed)
    vertices, faces = grid(20, 0.4, lambda x, y: 0 * x)
    waves = sum(
        rng.normal(0, 0.03, 3) * np.sin(vertices[:, :2] @ rng.normal(0, 18, 2) + rng.uniform(0, 6.3))[:, None]
        for _ in range(6)
    )
    vertices = vertices * [0.6, 0.6, 1] + waves
    vertices[:, 2] -= vertices[:, 2].min()
    return vertices.astype(np.float32), faces


def tilted() -> Camera:
    c, s = np.cos(0.6), np.sin(0.6)
    T = np.array([[1, 0, 0, 0.02], [0, -c, -s, 0.3], [0, s, -c, 0.6], [0, 0, 0, 1]])
    return Camera(np.array([[80.0, 0.0, 41.0], [0.0, 78.0, 30.0], [0.0, 0.0, 1.0]]), T, 80, 60)


def cast(vertices, faces, origin, directions):
    """Ray casting (Möller and Trumbore): for every ray and face the ray parameter, inf where it misses."""
    a, b, c = (vertices[faces[:, k]].astype(np.float64) for k in range(3))
    p = np.cross(directions[:, None], (c - a)[None])
    scale = np.einsum("fi,rfi->rf", b - a, p)
    s = origin - a
    with np.errstate(divide="ignore", invalid="ignore"):
        u = np.einsum("fi,rfi->rf", s, p) / scale
        q = np.cross(s, b - a)
        v = np.einsum("ri,fi->rf", directions, q) / scale
        t = np.einsum("fi,fi->f", c - a, q) / scale
    return np.where((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0), t, np.inf)


@pytest.mark.parametrize("camera", [overhead(64), tilted()], ids=["overhead", "tilted"])
@pytest.mark.parametrize("seed", range(3))
def test_raster_equals_casting_a_ray_through_every_pixel(camera, seed):
    vertices, faces = crumple(seed)
    raster = rasterize(vertices, faces, camera)
    hits = cast(vertices, faces, camera.position, camera.rays().reshape(-1, 3))
    nearest = hits.min(axis=1).reshape(raster.depth.shape)
    differing = raster.mask != np.isfinite(nearest)
    assert raster.mask.mean() > 0.05
    assert not differing.any()
    np.testing.assert_allclose(raster.depth[raster.mask], nearest[raster.mask], atol=1e-6)
    faces_seen = hits.argmin(axis=1).reshape(raster.face.shape)
    assert (faces_seen == raster.face)[raster.mask].mean() > 0.999


def test_barycentric_coordinates_rebuild_the_point_that_was_seen():
    camera = tilted()
    vertices, faces = crumple(3)
    raster = rasterize(vertices, faces, camera)
    corners = vertices[faces[raster.face[raster.mask]]]
    points = np.einsum("nk,nki->ni", raster.barycentric[raster.mask], corners)
    np.testing.assert_allclose(points, camera.back_project(raster.depth)[raster.mask], atol=2e-6)
    np.testing.assert_allclose(raster.barycentric[raster.mask].sum(axis=1), 1, atol=1e-6)
    assert (raster.barycentric >= 0).all()
    assert not raster.barycentric[~raster.mask].any()


def test_plane_has_its_analytic_depth():
    camera = overhead(90)
    vertices, faces = grid(5, 0.2, lambda x, y: 0.1 + 0.4 * x - 0.3 * y)
    depth = rasterize(vertices, faces, camera).depth
    rays = camera.rays()  # origin (0, 0, 0.65) + t * ray meets z = 0.1 + 0.4 x - 0.3 y at:
    expected = (0.1 - 0.65) / (rays[..., 2] - 0.4 * rays[..., 0] + 0.3 * rays[..., 1])
    assert (depth > 0).sum() > 500
    np.testing.assert_allclose(depth[depth > 0], expected[depth > 0], atol=1e-7)


def test_a_sheet_has_no_cracks_along_its_edges():
    # Vertices exactly on pixel centres and edges exactly through them: the hardest case for shared edges.
    camera = overhead(200)
    side = 0.65 * 60 / camera.K[0, 0]
    vertices, faces = grid(11, side, lambda x, y: 0 * x)
    vertices[:, :2] += 0.65 * 0.5 / camera.K[0, 0]
    inner = rasterize(vertices, faces, camera).mask[72:128, 72:128]
    assert inner.all()


def test_both_sides_are_seen_and_the_order_of_faces_does_not_matter():
    vertices, faces = crumple(4)
    seen = rasterize(vertices, faces, overhead(100))
    turned = rasterize(vertices, faces[::-1, ::-1], overhead(100))
    np.testing.assert_allclose(seen.depth, turned.depth, atol=1e-6)


def test_a_face_reaching_behind_the_camera_is_cut_not_dropped():
    vertices = np.array([[-1, 0.05, 0.4], [1, 0.05, 0.4], [0, -4, 3.0]], np.float32)
    camera = overhead(50)
    raster = rasterize(vertices, np.array([[0, 1, 2]]), camera)
    hits = cast(vertices, np.array([[0, 1, 2]]), camera.position, camera.rays().reshape(-1, 3))
    expected = np.isfinite(hits).reshape(raster.mask.shape)
    assert expected.any()
    assert not expected.all()
    np.testing.assert_array_equal(raster.mask, expected)


def test_nothing_to_see():
    vertices, faces = grid(4, 0.1, lambda x, y: 0 * x + 0.9)  # above the camera
    raster = rasterize(vertices, faces, overhead(30))
    assert not raster.mask.any()
    assert not raster.depth.any()
    line = np.array([[0, 0, 0], [0.1, 0, 0], [0.2, 0, 0]], np.float32)
    assert not rasterize(line, np.array([[0, 1, 2]]), overhead(30)).mask.any()


def test_a_vertex_that_is_not_a_number_tears_only_its_own_faces():
    vertices, faces = grid(6, 0.2, lambda x, y: 0 * x)
    whole = rasterize(vertices, faces, overhead(80)).mask
    for broken in ([np.nan, 0, 0], [0, np.nan, 0], [0, 0, np.nan]):
        torn = vertices.copy()
        torn[14] += np.array(broken, np.float32)
        mask = rasterize(torn, faces, overhead(80)).mask
        assert (mask <= whole).all()
        assert 0.7 * whole.sum() < mask.sum() < whole.sum()
        assert not visible_vertices(torn, faces, overhead(80))[14]


def test_a_layer_5_mm_below_another_is_hidden_where_it_is_covered():
    upper, upper_faces = grid(9, 0.1, lambda x, y: 0 * x + 0.005)
    lower, lower_faces = grid(21, 0.2, lambda x, y: 0 * x)
    vertices = np.concatenate([upper, lower])
    faces = np.concatenate([upper_faces, lower_faces + len(upper)])
    visible = visible_vertices(vertices, faces, overhead(720))
    assert visible[: len(upper)].all()
    # The shadow of the upper layer on the table, seen from the camera, is larger by 0.65 / 0.645.
    reach = np.abs(lower[:, :2]).max(axis=1)
    shadow = 0.05 * 0.65 / 0.645
    np.testing.assert_array_equal(visible[len(upper) :], reach > shadow)
    # A tolerance larger than the gap sees through it.
    assert visible_vertices(vertices, faces, overhead(720), tolerance=0.006).all()


@pytest.mark.parametrize("camera", [overhead(200), tilted()], ids=["overhead", "tilted"])
def test_visibility_equals_casting_a_ray_at_every_vertex(camera):
    vertices, faces = crumple(5)
    directions = (vertices - camera.position).astype(np.float64)
    directions /= (directions @ camera.T_world_camera[:3, 2])[:, None]  # unit depth: parameters are depths
    _, depth = camera.project(vertices)
    blocked = (cast(vertices, faces, camera.position, directions) < depth[:, None] - 0.002).any(axis=1)
    visible = visible_vertices(vertices, faces, camera)
    np.testing.assert_array_equal(visible, camera.contains(vertices) & ~blocked)
    assert 0.2 < visible.mean() < 0.95


def test_vertices_outside_the_image_are_not_visible():
    vertices, faces = grid(11, 1.0, lambda x, y: 0 * x)
    np.testing.assert_array_equal(
        visible_vertices(vertices, faces, overhead()), np.abs(vertices[:, :2]).max(axis=1) < 0.269
    )
