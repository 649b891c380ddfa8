"""An episode as one self-contained HTML page: what the camera saw, what was considered, what was done, what it gave."""

import base64
import html
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from medor_cloth.camera import Camera
from medor_cloth.picture import depth_picture, png_bytes

Point = tuple[float, float, float]


@dataclass(frozen=True)
class Arrow:
    """A pick-and-place in task space [m] and its predicted reward."""

    pick: Point
    place: Point
    reward: float = 0.0


@dataclass(frozen=True)
class Step:
    """One pick: the view before it, the mesh it was planned on, and the state after it."""

    index: int
    depth: NDArray[np.float32]
    """(H, W) [m], 0 where there is no cloth."""
    camera: Camera
    vertices: NDArray[np.float32]
    """(V, 3) task space [m]."""
    edges: NDArray[np.int32]
    """(E, 2)."""
    candidates: Sequence[Arrow]
    """Best first."""
    action: Arrow | None
    """None when doing nothing was predicted best."""
    no_op_reward: float
    coverage_m2: float
    ni: float
    timings_ms: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Report:
    """Everything the page shows."""

    title: str
    facts: dict[str, str]
    """Name and value, in the order shown."""
    start_ni: float
    steps: Sequence[Step]
    final: NDArray[np.float32] | None = None
    """Depth image after the last pick."""


def page(report: Report) -> str:
    """The report as HTML; needs no network and no other file."""
    facts = "".join(f"<dt>{html.escape(k)}</dt><dd>{html.escape(v)}</dd>" for k, v in report.facts.items())
    cards = "".join(_card(step) for step in report.steps)
    if report.final is not None:
        cards += f"<article><h2>After the last pick</h2>{_image(report.final)}</article>"
    return _PAGE.format(
        title=html.escape(report.title),
        facts=facts,
        curve=_curve([report.start_ni, *(step.ni for step in report.steps)]),
        cards=cards,
    )


def _card(step: Step) -> str:
    stages = " · ".join(f"{name} {ms / 1000:.2f} s" for name, ms in step.timings_ms.items())
    done = "nothing (predicted best)" if step.action is None else _describe(step.action)
    return (
        f"<article><h2>Pick {step.index} <small>NI {step.ni:.3f} · coverage {step.coverage_m2 * 1e4:.0f} cm²</small>"
        f"</h2>{_scene(step)}<p>{done}<br>predicted {step.action.reward if step.action else step.no_op_reward:.4f},"
        f" doing nothing {step.no_op_reward:.4f}</p><p class=t>{stages}</p></article>"
    )


def _describe(action: Arrow) -> str:
    pick, place = (f"({x * 100:.1f}, {y * 100:.1f}, {z * 100:.1f}) cm" for x, y, z in (action.pick, action.place))
    return f"{pick} → {place}"


def _scene(step: Step) -> str:
    """Depth image with the mesh's edges, the candidates and the action drawn over it, in image pixels."""
    height, width = step.depth.shape
    picture = base64.b64encode(png_bytes(depth_picture(step.depth))).decode()
    return (
        f'<svg viewBox="0 0 {width} {height}"><image href="data:image/png;base64,{picture}" width="{width}"'
        f' height="{height}"/><path class=mesh d="{_mesh_path(step)}"/><g class=candidates>{_candidates(step)}</g>'
        + (_arrow(step.camera, step.action, "chosen", "#fff") if step.action else "")
        + "</svg>"
    )


def _image(depth: NDArray[np.float32]) -> str:
    height, width = depth.shape
    picture = base64.b64encode(png_bytes(depth_picture(depth))).decode()
    return f'<svg viewBox="0 0 {width} {height}"><image href="data:image/png;base64,{picture}" width="{width}"/></svg>'


def _mesh_path(step: Step) -> str:
    if len(step.edges) == 0:
        return ""
    uv, _ = step.camera.project(step.vertices)
    lines = np.rint(uv[step.edges]).astype(int).reshape(-1, 4)
    return "".join(f"M{a} {b}L{c} {d}" for a, b, c, d in lines.tolist())


def _candidates(step: Step) -> str:
    """Worst first, so that the best lie on top."""
    rewards = np.array([arrow.reward for arrow in step.candidates])
    spread = float(np.ptp(rewards)) if len(rewards) else 0.0
    shares = (rewards - rewards.min()) / spread if spread > 0 else np.ones(len(rewards))
    drawn = [
        _arrow(step.camera, arrow, "candidate", _colour(float(share)))
        for arrow, share in zip(step.candidates, shares, strict=True)
    ]
    return "".join(drawn[::-1])


def _arrow(camera: Camera, arrow: Arrow, kind: str, colour: str) -> str:
    uv, _ = camera.project(np.array([arrow.pick, arrow.place]))
    (x0, y0), (x1, y1) = uv
    return (
        f'<g class={kind} stroke="{colour}" fill="{colour}"><line x1="{x0:.1f}" y1="{y0:.1f}" x2="{x1:.1f}"'
        f' y2="{y1:.1f}" marker-end="url(#head)"/><circle cx="{x0:.1f}" cy="{y0:.1f}" r="4"/></g>'
    )


def _colour(share: float) -> str:
    """From blue (worst drawn) over green to yellow (best), in steps a colour-blind reader can order."""
    stops = np.array([[68, 84, 160], [33, 145, 140], [122, 209, 81], [253, 231, 37]])
    place = share * (len(stops) - 1)
    low = min(int(place), len(stops) - 2)
    red, green, blue = stops[low] + (stops[low + 1] - stops[low]) * (place - low)
    return f"#{int(red):02x}{int(green):02x}{int(blue):02x}"


def _curve(ni: Sequence[float]) -> str:
    """NI over picks as an inline picture, from the start state on."""
    width, height, left, bottom = 620, 240, 46, 28
    low = min(0.0, *ni)
    xs = left + (width - left - 14) * np.arange(len(ni)) / max(len(ni) - 1, 1)
    ys = (height - bottom) - (height - bottom - 14) * (np.array(ni) - low) / (max(1.0, *ni) - low)
    scale = (height - bottom - 14) / (max(1.0, *ni) - low)
    grid = "".join(
        f'<line class=grid x1="{left}" x2="{width - 14}" y1="{y:.1f}" y2="{y:.1f}"/>'
        f'<text x="{left - 8}" y="{y + 4:.1f}" text-anchor=end>{value:.2f}</text>'
        for value in (0.0, 0.25, 0.5, 0.75, 0.95)
        for y in [(height - bottom) - (value - low) * scale]
    )
    ticks = "".join(
        f'<text x="{x:.1f}" y="{height - 8}" text-anchor=middle>{i}</text>' for i, x in enumerate(xs.tolist())
    )
    points = " ".join(f"{x:.1f},{y:.1f}" for x, y in zip(xs, ys, strict=True))
    dots = "".join(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4"/>' for x, y in zip(xs, ys, strict=True))
    return f'<svg class=curve viewBox="0 0 {width} {height}">{grid}{ticks}<polyline points="{points}"/>{dots}</svg>'


_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>{title}</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<style>
body {{ font: 15px/1.5 system-ui, sans-serif; margin: 2rem auto; max-width: 1240px; padding: 0 1rem;
       background: #f6f6f4; color: #222 }}
header {{ display: flex; flex-wrap: wrap; gap: 2rem; align-items: flex-start; margin-bottom: 1.5rem }}
h1 {{ font-size: 1.5rem; margin: 0 0 .6rem }} h2 {{ font-size: 1.05rem; margin: .2rem 0 .5rem }}
small {{ font-weight: 400; color: #555 }}
dl {{ display: grid; grid-template-columns: auto auto; gap: .1rem 1rem; margin: 0 }}
dt {{ color: #666 }} dd {{ margin: 0 }}
main {{ display: grid; grid-template-columns: repeat(auto-fill, minmax(360px, 1fr)); gap: 1.2rem }}
article, .curve {{ background: #fff; border: 1px solid #ddd; border-radius: 8px }}
article {{ padding: .8rem }} article svg {{ width: 100%; background: #111; border-radius: 4px }}
.curve {{ width: 620px; max-width: 100% }} .curve polyline {{ fill: none; stroke: #1f6f8b; stroke-width: 2.5 }}
.curve circle {{ fill: #1f6f8b }} .grid {{ stroke: #e4e4e0 }} .curve text {{ font-size: 11px; fill: #666 }}
.mesh {{ fill: none; stroke: #fff; stroke-opacity: .28; stroke-width: 1 }}
.candidate {{ stroke-width: 2.5; stroke-opacity: .8 }} .chosen {{ stroke-width: 6 }}
p {{ margin: .5rem 0 0; font-variant-numeric: tabular-nums }} .t {{ color: #666; font-size: 13px }}
#mesh:not(:checked) ~ main .mesh, #candidates:not(:checked) ~ main .candidates {{ display: none }}
</style></head><body>
<svg width="0" height="0" style="position:absolute"><defs><marker id="head" viewBox="0 0 10 10" refX="8" refY="5"
 markerWidth="4.5" markerHeight="4.5" orient="auto"><path d="M0 0L10 5L0 10z" fill="context-stroke" stroke="none"/>
</marker></defs></svg>
<header><div><h1>{title}</h1><dl>{facts}</dl></div>
<div><b>Normalized improvement over picks</b><br>{curve}</div></header>
<input type="checkbox" id="mesh" checked><label for="mesh"> mesh the plan was made on</label>
<input type="checkbox" id="candidates" checked><label for="candidates"> best candidates
 (blue worst, yellow best); white: what was done</label>
<main>{cards}</main>
</body></html>
"""
