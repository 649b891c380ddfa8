import numpy as np

from medor_dynamics.physics import by_rest_shape, solver_of
from medor_wire.examples import mesh


def longest(solver) -> float:
    return float(solver.cloth.rest_lengths.max())


def test_a_mesh_without_panels_rests_in_canonical_space_not_as_it_lies():
    flat = mesh().model_copy(update={"panel_uv": None})
    stretched = flat.model_copy(update={"vertices": flat.vertices * np.float32(2)})
    as_it_lies = stretched.model_copy(update={"canonical": None})
    assert longest(solver_of(by_rest_shape(stretched))) == longest(solver_of(by_rest_shape(flat)))
    assert np.isclose(longest(solver_of(by_rest_shape(as_it_lies))), 2 * longest(solver_of(by_rest_shape(flat))))


def test_the_solver_of_a_known_rest_shape_is_kept_when_the_cloth_moves():
    flat = mesh().model_copy(update={"panel_uv": None})
    moved = flat.model_copy(update={"vertices": flat.vertices + np.float32(0.1)})
    assert by_rest_shape(flat) == by_rest_shape(moved)
    assert by_rest_shape(flat.model_copy(update={"canonical": None})) != by_rest_shape(
        moved.model_copy(update={"canonical": None})
    )
