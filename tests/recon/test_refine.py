from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import KDTree

from medor_cloth.raster import visible_vertices
from medor_recon.refine import HELD, JOINT, NO_CONSISTENCY, PAPER, Phase, RefineConfig, refine, terms
from medor_recon.refine.adam import Adam
from medor_recon.refine.binding import bind
from medor_wire.errors import ReconstructionFailed

from .crumpled import CAMERA, filled, folded, garment, seen, warped


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(7)


def cloud(rng, n: int) -> np.ndarray:
    return rng.uniform(-0.1, 0.1, (n, 3))


def distance(positions: np.ndarray) -> np.ndarray:
    return np.linalg.norm(positions - folded(), axis=1)


def hidden() -> np.ndarray:
    return ~visible_vertices(folded(), garment().faces, CAMERA)


def slope(value, positions: np.ndarray, step: float = 1e-6) -> np.ndarray:
    """The gradient of a function of (V, 3) by central differences."""
    found = np.zeros_like(positions)
    for index in np.ndindex(*positions.shape):
        there = np.zeros_like(positions)
        there[index] = step
        found[index] = (value(positions + there) - value(positions - there)) / (2 * step)
    return found


def each_term(rng):
    vertices, points = cloud(rng, 12), cloud(rng, 60)
    edges = np.array([[0, 1], [1, 2], [3, 7], [10, 11]])
    rests = np.array([0.01, 0.02, 0.5, 0.03])
    return vertices, {
        "chamfer": lambda x: terms.chamfer(points, x, np.array([1, 2, 3, 5, 8, 9])),
        "consistency": lambda x: terms.consistency(x, np.array([0, 4, 11]), points[:3]),
        "table": terms.table,
        "stretch": lambda x: terms.stretch(x, edges, rests),
    }


@pytest.mark.parametrize("name", ["chamfer", "consistency", "table", "stretch"])
def test_gradients_are_those_of_finite_differences(rng, name):
    vertices, found = each_term(rng)
    term = found[name]
    expected = slope(lambda x: term(x)[0], vertices)
    assert np.abs(expected).max() > 0
    assert term(vertices)[1] == pytest.approx(expected, rel=1e-4, abs=1e-9)


def loss_of(torch, x, points, bound):
    """The finetuning loss as autograd understands it."""
    p, t = torch.tensor(points), torch.tensor(points[: len(bound)])
    square = ((p[:, None] - x[None]) ** 2).mean(dim=2).min(dim=1).values
    drawn = ((x[bound] - t) ** 2).sum() / len(bound)
    return square.mean() + 10 * drawn + 10 * (torch.relu(0.005 - x[:, 2]) ** 2).mean()


def loss_here(x, points, bound) -> terms.Term:
    parts = [
        terms.chamfer(points, x, np.arange(len(x))),
        terms.consistency(x, bound, points[: len(bound)]),
        terms.table(x),
    ]
    return tuple(sum(weight * part[k] for weight, part in zip((1, 10, 10), parts, strict=True)) for k in (0, 1))  # type: ignore[return-value]


def test_weighted_sum_and_its_gradient_are_those_of_autograd(rng):
    torch = pytest.importorskip("torch")
    points, vertices, bound = cloud(rng, 50), cloud(rng, 9), np.array([1, 4])
    x = torch.tensor(vertices, requires_grad=True)
    loss = loss_of(torch, x, points, bound)
    loss.backward()
    value, gradient = loss_here(vertices, points, bound)
    assert value == pytest.approx(float(loss.detach()), rel=1e-9)
    assert gradient == pytest.approx(x.grad.numpy(), rel=1e-9)


@pytest.mark.slow
def test_steps_are_those_of_torch(rng):
    torch = pytest.importorskip("torch")
    points, vertices, bound = cloud(rng, 50), cloud(rng, 9), np.array([1, 4])
    x = torch.tensor(vertices, requires_grad=True)
    theirs, ours = torch.optim.Adam([x], lr=1e-3), Adam(vertices.shape, 1e-3)
    for _ in range(20):
        theirs.zero_grad()
        loss_of(torch, x, points, bound).backward()
        theirs.step()
        vertices = vertices + ours.step(loss_here(vertices, points, bound)[1])
    assert vertices == pytest.approx(x.detach().numpy(), abs=1e-9)


def test_nearest_visible_vertex_is_the_one_of_a_search_tree(rng):
    points, vertices, visible = cloud(rng, 500), cloud(rng, 300), np.arange(0, 300, 3)
    owner, square = terms.nearest(points, vertices, visible)
    expected, row = KDTree(vertices[visible]).query(points)
    assert np.array_equal(owner, visible[row])
    assert square == pytest.approx(expected**2)


def test_vertices_are_bound_to_the_mean_of_the_points_in_their_cell():
    nocs = np.array([[0.5, 0.5, 0.5], [0.501, 0.501, 0.501], [0.9, 0.9, 0.9], [1.0, 1.0, 1.0]])
    points = np.array([[0.0, 0, 0], [0.02, 0, 0], [1, 1, 1], [2, 2, 2]])
    there = np.array([[0.505, 0.505, 0.505], [0.53, 0.508, 0.508], [0.7, 0.7, 0.7], [0.99, 0.99, 0.99]])
    binding = bind(there, nocs, points, reach=2 / 64)
    assert binding.vertices.tolist() == [0, 1, 3], "the third is farther than two cells from any point"
    assert binding.targets == pytest.approx(np.array([[0.01, 0, 0], [0.01, 0, 0], [2, 2, 2]]))


def test_loss_decreases_in_both_phases(rng):
    config = replace(PAPER, look_every=1)
    losses = refine(warped(rng, 0.015), seen(), config).losses
    first, second = PAPER.phases
    early = losses["chamfer"] + 10 * losses["consistency"] + 10 * losses["table"]
    late = losses["chamfer"] + 10 * losses["table"]
    assert early[first.iterations - 1] < 0.3 * early[0]
    assert late[-1] < late[first.iterations]
    assert len(late) == first.iterations + second.iterations


def errors(positions: np.ndarray) -> tuple[float, float]:
    """Mean error of the visible and of the hidden vertices [m]."""
    covered = hidden()
    return distance(positions)[~covered].mean(), distance(positions)[covered].mean()


@pytest.mark.parametrize("config", [PAPER, HELD], ids=["paper", "held"])
def test_finetuning_brings_a_warped_mesh_onto_the_view(rng, config):
    completed, view = warped(rng, 0.015), seen(0.005, rng)
    before, after = refine(completed, view, None), refine(completed, view, config)
    assert after.residual_m < 0.6 * before.residual_m
    visible_before, hidden_before = errors(completed.positions)
    visible_after, hidden_after = errors(after.positions)
    assert visible_after < 0.65 * visible_before
    assert hidden_after < 1.25 * hidden_before, "where hidden and visible part err alike, moving one leaves the other"


def test_finetuning_spares_the_hidden_part_and_the_prior_mends_it(rng):
    view = seen(0.02, rng)
    completed = filled(view)
    _, before = errors(completed.positions)
    _, paper = errors(refine(completed, view, PAPER).positions)
    _, held = errors(refine(completed, view, HELD).positions)
    assert paper < 1.05 * before
    assert held < 0.85 * before


def test_hidden_vertices_without_a_term_stay_where_they_are(rng):
    completed = warped(rng, 0.002)
    config = RefineConfig(phases=(Phase(consistency=0.0, table=0.0),), look_every=1)
    after = refine(completed, seen(), config).positions
    covered = hidden() & ~refine(completed, seen(), None).visible & ~refine(completed, seen(), config).visible
    moved = np.abs(after - completed.positions).max(axis=1)
    assert covered.sum() > 50
    assert (moved[covered] == 0).mean() > 0.9, "but for those that came into view for a moment"
    assert moved[~hidden()].mean() > 5e-4


def test_no_vertex_moves_farther_than_its_steps_allow(rng):
    config = RefineConfig(phases=(Phase(iterations=20), Phase(iterations=15, consistency=0.0)))
    completed = warped(rng, 0.1)
    moved = np.abs(refine(completed, seen(), config).positions - completed.positions)
    assert moved.max() <= 35 * config.learning_rate * 1.01
    assert moved.max() > 25 * config.learning_rate


def test_consistency_counts_in_the_first_fifty_iterations_only(rng):
    completed, view = warped(rng, 0.015), seen(0.02, rng)
    first = replace(PAPER, phases=PAPER.phases[:1])
    halfway = refine(completed, view, first)
    assert [phase.iterations for phase in PAPER.phases] == [50, 50]
    paper, joint, without = (refine(completed, view, config) for config in (PAPER, JOINT, NO_CONSISTENCY))
    for name in ("chamfer", "consistency", "table"):
        assert np.array_equal(paper.losses[name][:50], halfway.losses[name])
        assert np.array_equal(paper.losses[name][:50], joint.losses[name][:50])
    assert paper.losses["consistency"][50:].mean() > joint.losses["consistency"][50:].mean()
    assert paper.residual_m < joint.residual_m, "wrong canonical coordinates hold the vertices back"
    assert without.losses["consistency"][49] > paper.losses["consistency"][49]


def test_table_term_lifts_what_lies_too_low(rng):
    completed = warped(rng, 0.0)
    sunk = replace(completed, positions=completed.positions - np.array([0, 0, 0.012], np.float32))
    after = refine(sunk, seen(), RefineConfig(phases=(Phase(chamfer=0.0, consistency=0.0),)))
    low = sunk.positions[:, 2] < terms.CLEARANCE_M
    assert low.any()
    lifted = after.positions[low, 2]
    assert lifted.min() >= terms.CLEARANCE_M
    assert lifted.max() < terms.CLEARANCE_M + 0.01, "only momentum carries them on"
    assert np.array_equal(after.positions[~low], sunk.positions[~low])


def test_stretch_prior_holds_the_cloth_together(rng):
    completed, view = warped(rng, 0.015), seen(0.01, rng)
    edges = np.unique(np.sort(completed.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)

    def excess(config: RefineConfig) -> float:
        sides = np.diff(refine(completed, view, config).positions[edges], axis=1)[:, 0]
        rest = np.diff(completed.canonical[edges], axis=1)[:, 0]
        return np.maximum(np.linalg.norm(sides, axis=1) - np.linalg.norm(rest, axis=1), 0).mean()

    assert excess(HELD) < 0.3 * excess(PAPER)


def test_same_input_same_result(rng):
    completed, view = warped(rng, 0.01), seen()
    assert np.array_equal(refine(completed, view).positions, refine(completed, view).positions)


def test_a_mesh_out_of_view_or_not_finite_is_refused(rng):
    completed = warped(rng, 0.01)
    with pytest.raises(ReconstructionFailed, match="sees nothing"):
        refine(replace(completed, positions=completed.positions + np.array([2, 0, 0], np.float32)), seen())
    broken = completed.positions.copy()
    broken[3] = np.nan
    with pytest.raises(ReconstructionFailed, match="finite"):
        refine(replace(completed, positions=broken), seen())
