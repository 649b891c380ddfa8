"""Curves and intervals as inline SVG."""

import html
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.ablation import Row
from benchmarks.episodes import Variant
from benchmarks.published import METHODS

COLOURS = (
    "#1b1b1b", "#7a7a7a", "#5a7f2b", "#0a3d6b", "#0b5fa5", "#0b5fa5", "#e07b00", "#b3202a", "#d66ba0", "#7b3fa0",
    "#1f8a4c", "#8c564b", "#12a0a8", "#b0b0b0",
)  # fmt: skip
"""By method, in the order of the table. With the solver in place of learned dynamics a line is dashed."""
LABEL_PX = 13


@dataclass(frozen=True)
class Curve:
    """NI after 0, 1, … picks."""

    variant: Variant
    name: str
    values: NDArray[np.float64]


@dataclass(frozen=True)
class Frame:
    """A plot's size and what its axes span."""

    width: int
    height: int
    picks: int
    low: float
    right: int = 12
    """Room for names [px]."""

    def x(self, pick: float) -> float:
        return 34 + (self.width - 34 - self.right) * pick / max(self.picks, 1)

    def y(self, ni: float) -> float:
        return self.height - 22 - (self.height - 32) * (ni - self.low) / (1 - self.low)


def plot(curves: Sequence[Curve], frame: Frame) -> str:
    """NI over picks, a line for each curve; named at their ends where there is room."""
    drawn = "".join(_line(curve, frame) for curve in curves) + (_names(curves, frame) if frame.right > LABEL_PX else "")
    return f'<svg class=plot viewBox="0 0 {frame.width} {frame.height}">{_axes(frame)}{drawn}</svg>'


def _axes(frame: Frame) -> str:
    levels = [level for level in np.arange(-1, 1.01, 0.25 if frame.height > 250 else 0.5) if level >= frame.low]
    lines = "".join(
        f'<line class="{"zero" if level == 0 else "grid"}" x1="{frame.x(0):.1f}" x2="{frame.x(frame.picks):.1f}"'
        f' y1="{frame.y(level):.1f}" y2="{frame.y(level):.1f}"/>'
        f'<text x="{frame.x(0) - 5:.1f}" y="{frame.y(level) + 4:.1f}" text-anchor=end>{level:.3g}</text>'
        for level in levels
    )
    ticks = [pick for pick in (0, 1, 2, 3, 5, 10, 20, 50, 100) if pick <= frame.picks]
    return lines + "".join(
        f'<text x="{frame.x(pick):.1f}" y="{frame.height - 6}" text-anchor=middle>{pick}</text>' for pick in ticks
    )


def _line(curve: Curve, frame: Frame) -> str:
    points = " ".join(f"{frame.x(pick):.1f},{frame.y(ni):.1f}" for pick, ni in enumerate(curve.values))
    tip = html.escape(f"{curve.name}: " + ", ".join(f"{ni:.2f}" for ni in curve.values))
    return f'<polyline points="{points}" {style(curve.variant)}><title>{tip}</title></polyline>'


def _names(curves: Sequence[Curve], frame: Frame) -> str:
    """Each curve's name beside its end, moved down where it would cover the one above."""
    names, lowest = "", -np.inf
    for curve in sorted(curves, key=lambda curve: -curve.values[-1]):
        lowest = max(frame.y(curve.values[-1]) + 4, lowest + LABEL_PX)
        names += (
            f'<text class=name x="{frame.x(frame.picks) + 7:.1f}" y="{lowest:.1f}" fill="{colour(curve.variant)}">'
            f"{html.escape(curve.name)}</text>"
        )
    return names


def bar(row: Row, low: float) -> str:
    """A row's NI as a dot, its interval as a line, the paper's figure as a hollow diamond, on an axis up to 1."""
    width, height = 160, 20

    def x(ni: float) -> float:
        return 6 + (width - 12) * (ni - low) / (1 - low)

    drawn = "".join(
        f'<line class="{"zero" if level == 0 else "grid"}" x1="{x(level):.1f}" x2="{x(level):.1f}" y2="{height}"/>'
        for level in np.arange(-1, 1.01, 0.25)
        if level >= low
    )
    if row.interval:
        left, right = row.interval
        drawn += f'<line x1="{x(left):.1f}" x2="{x(right):.1f}" y1="10" y2="10" stroke="{colour(row.variant)}"/>'
    drawn += f'<circle cx="{x(row.ni):.1f}" cy="10" r="4.5" fill="{colour(row.variant)}"/>'
    if row.published:
        at = x(row.published.ni)
        drawn += f'<path class=paper d="M{at:.1f} 4l6 6l-6 6l-6-6z"><title>paper {row.published.ni:.3f}</title></path>'
    return f'<svg class=bar viewBox="0 0 {width} {height}">{drawn}</svg>'


def style(variant: Variant) -> str:
    """Stroke of a variant's line."""
    method, _, unusual = variant.label.partition(" (")
    dashes = ' stroke-dasharray="6 4"' if method.endswith("+physics") or unusual else ""
    return f'stroke="{colour(variant)}"{dashes}'


def colour(variant: Variant) -> str:
    """Of the method; a method with the solver looks like the same one with learned dynamics."""
    method = variant.label.split(" (")[0].removesuffix("+physics")
    return COLOURS[METHODS.index(method)] if method in METHODS else "#999999"
