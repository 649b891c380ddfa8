"""A garment laid flat: front up, layers apart, nothing crossing, hardly strained."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from medor_cloth.garment import CATEGORIES, Garment, generate
from medor_cloth.intersection import self_intersections
from medor_cloth.layout import CLEARANCE_M, LAYER_GAP_M, SQUASHED_M

SEWN_SKIRT = 800_005
"""A dress whose skirt is a sector sewn on a straight waist."""


@cache
def garment(category: str, seed: int = SEWN_SKIRT) -> Garment:
    return generate(category, seed)


def upward(positions, faces):
    """(F,) twice the signed area of each face seen from above."""
    a, b, c = (positions[faces[:, k], :2].astype(float) for k in range(3))
    return (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]


@pytest.mark.parametrize("category", CATEGORIES)
def test_front_lies_over_back_with_the_cloth_thickness_between(category):
    flat = garment(category).laid_flat()
    heights = np.unique(flat[:, 2])
    np.testing.assert_allclose(heights, CLEARANCE_M + LAYER_GAP_M * np.array([0, 0.5, 1]), atol=1e-6)
    faces = garment(category).faces
    front = upward(flat, faces) > 0
    assert (flat[faces[front], 2].mean(axis=1) > CLEARANCE_M + LAYER_GAP_M / 2).all()
    assert (flat[faces[~front], 2].mean(axis=1) < CLEARANCE_M + LAYER_GAP_M / 2).all()


@pytest.mark.parametrize("category", CATEGORIES)
def test_no_face_is_turned_over_and_none_cross(category):
    flat, worn, faces = garment(category).laid_flat(), garment(category).vertices, garment(category).faces
    a, b, c = (worn[faces[:, k]] for k in range(3))
    faces_front = np.cross(b - a, c - a)[:, 1] < 0
    assert ((upward(flat, faces) > 0) == faces_front).mean() > 0.97  # but for the rounded sides of the worn shape
    assert self_intersections(flat, faces) == 0


@pytest.mark.parametrize("category", CATEGORIES)
def test_cloth_is_nearly_at_rest(category):
    made = garment(category)
    assert made.panel_uv is not None
    flat, uv = made.laid_flat()[made.faces], made.panel_uv
    lengths = np.linalg.norm(np.roll(flat, -1, axis=1) - flat, axis=2)
    strain = lengths / np.linalg.norm(np.roll(uv, -1, axis=1) - uv, axis=2) - 1
    assert np.percentile(np.abs(strain), 90) < 0.06
    assert np.abs(strain).max() < 0.35


def test_a_sector_sewn_on_a_straight_waist_is_not_torn():
    made = garment("dress")
    uv = made.panel_uv
    assert uv is not None
    places = np.zeros((len(made.vertices), 2))
    places[made.faces.ravel()] = uv.reshape(-1, 2)
    gap = np.abs(uv.reshape(-1, 2) - places[made.faces.ravel()]).max()
    assert gap > 0.005, "this dress must have a waist drawn differently on its two sides"
    doubled = np.abs(upward(made.laid_flat(), made.faces))
    (ux, uy), (vx, vy) = (uv[:, 1] - uv[:, 0]).T, (uv[:, 2] - uv[:, 0]).T
    panel = np.abs(ux * vy - uy * vx)
    assert (doubled > 0.5 * panel).all()
    assert doubled.sum() == pytest.approx(panel.sum(), rel=0.03)


@pytest.mark.parametrize("category", CATEGORIES)
def test_body_up_is_world_up_and_the_layout_is_centred(category):
    made = garment(category)
    flat = made.laid_flat()
    assert np.corrcoef(flat[:, 0], made.vertices[:, 0])[0, 1] > 0.95
    assert np.corrcoef(flat[:, 1], made.vertices[:, 2])[0, 1] > 0.95
    np.testing.assert_allclose(flat[:, :2].max(axis=0) + flat[:, :2].min(axis=0), 0, atol=1e-6)


def test_panels_packed_anyhow_are_not_used_for_the_layout():
    made = garment("tshirt")
    assert made.panel_uv is not None
    turned = replace(made, panel_uv=np.ascontiguousarray(made.panel_uv[..., ::-1]))
    np.testing.assert_array_equal(turned.laid_flat(), replace(made, panel_uv=None).laid_flat())


def test_without_panels_the_worn_shape_is_squashed_in_order():
    made = replace(garment("trousers"), panel_uv=None)
    flat = made.laid_flat()
    order = np.argsort(made.vertices[:, 1])
    assert (np.diff(flat[order, 2]) <= 1e-7).all(), "nearer to the front means higher"
    assert np.ptp(flat[:, 2]) == pytest.approx(SQUASHED_M, abs=1e-5)
    assert flat[:, 2].min() == pytest.approx(CLEARANCE_M, abs=1e-6)
    assert self_intersections(flat, made.faces) == 0
