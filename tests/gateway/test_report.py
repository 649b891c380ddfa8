"""The episode page is self-contained and draws things where they are."""

import re

import numpy as np
import pytest

from medor_cloth.camera import overhead
from medor_gateway.report import Arrow, Report, Step, page


@pytest.fixture
def step() -> Step:
    depth = np.zeros((720, 720), np.float32)
    depth[200:400, 200:400] = 0.64
    return Step(
        index=1,
        depth=depth,
        camera=overhead(720),
        vertices=np.array([[-0.1, 0, 0], [0.1, 0, 0], [0, 0.1, 0]], np.float32),
        edges=np.array([[0, 1], [1, 2], [0, 2]], np.int32),
        candidates=[Arrow((0, 0, 0), (0.1, 0, 0.05), 0.03), Arrow((0, 0, 0), (0, 0.1, 0.05), 0.01)],
        action=Arrow((0, 0, 0), (0.1, 0, 0.05), 0.03),
        no_op_reward=0.02,
        coverage_m2=0.025,
        ni=0.4,
        timings_ms={"rollout": 1200.0},
    )


def test_the_page_needs_nothing_from_elsewhere(step: Step) -> None:
    text = page(Report("A <title>", {"method": "visible"}, 0.0, [step], step.depth))
    assert not re.search(r"""(?:src|href)=["'](?!data:)""", text)
    assert "A &lt;title&gt;" in text
    assert "http" not in text


def test_every_candidate_and_the_action_are_drawn(step: Step) -> None:
    text = page(Report("t", {}, 0.0, [step]))
    assert text.count("<g class=candidate ") == 2
    assert text.count("<g class=chosen ") == 1


def test_a_no_op_draws_no_action_and_says_so(step: Step) -> None:
    idle = Step(**{**step.__dict__, "action": None})
    text = page(Report("t", {}, 0.0, [idle]))
    assert "<g class=chosen " not in text
    assert "nothing (predicted best)" in text


def test_points_land_on_their_pixels(step: Step) -> None:
    """The origin of the table is the image centre; +x is right and +y is up in the image."""
    text = page(Report("t", {}, 0.0, [step]))
    x1, y1, x2, y2 = map(float, re.search(r'class=chosen.*?x1="(.*?)" y1="(.*?)" x2="(.*?)" y2="(.*?)"', text).groups())  # type: ignore[union-attr]
    assert (x1, y1) == (360.0, 360.0)
    assert x2 > x1
    assert y2 == y1


def test_the_mesh_is_one_segment_per_edge(step: Step) -> None:
    path = re.search(r'class=mesh d="(.*?)"', page(Report("t", {}, 0.0, [step])))
    assert path is not None
    assert path.group(1).count("M") == len(step.edges)
