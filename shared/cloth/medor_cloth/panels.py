"""The parametric sewing patterns of the five garment categories, human scale [m]."""

from collections.abc import Callable

import numpy as np

from medor_cloth.bodice import Bodice, mirrored
from medor_cloth.legs import Legs
from medor_cloth.outline import Curve, arc, line
from medor_cloth.pattern import Panel, Pattern, Seam, back_to_back

SLIT = 0.009
"""Half width of the gap between the two edges of a front opening, human scale [m]."""

BODICE_SEAMS = ("side_right", "shoulder_right", "shoulder_left", "side_left")
INSEAMS = ("inseam_left", "inseam_right")


def trousers(rng: np.random.Generator) -> Pattern:
    """Two equal panels; rims: waist and two hems."""
    legs = Legs.of_trousers(rng)
    right = {"outer_right": legs.outer_seam()[::-1]}
    waist = line((legs.waist, 0), (-legs.waist, 0))
    outline = {**legs.bottom(), **right, "waist": waist, **mirrored(right)}
    return Pattern(
        panels={"front": Panel(outline, front=True), "back": Panel(outline, front=False)},
        seams=back_to_back("outer_right", "outer_left", *INSEAMS),
        boundary_loops=3,
        flatness=rng.uniform(),
    )


def tshirt(rng: np.random.Generator) -> Pattern:
    """Front (whole, open or half open) and back; rims: neck, hem and two cuffs."""
    bodice = Bodice.sample(rng, sleeves=(0.12, 0.48, 0.40))
    side_end = (bodice.chest * rng.uniform(0.9, 1.12), -rng.uniform(0.42, 0.72))
    hem = _hem(side_end, drop=rng.uniform(-0.01, 0.04))
    opening = rng.choice(("closed", "open", "half"), p=(0.78, 0.14, 0.08))
    flatness = rng.uniform()
    if opening == "closed":
        panels = _front_and_back(bodice, line(side_end), hem)
        return Pattern(panels, back_to_back(*BODICE_SEAMS), boundary_loops=4, flatness=flatness)
    half_open = bool(opening == "half")
    right = _right_front(bodice, line(side_end), hem, half_open)
    panels = {
        "right": Panel(right, front=True),
        "left": Panel(mirrored(right), front=True),
        "back": Panel(bodice.outline(False, line(side_end), {"hem": hem}), front=False),
    }
    seams = tuple(Seam((name.split("_")[1], name), ("back", name)) for name in BODICE_SEAMS)
    closing = (Seam(("right", "closed"), ("left", "closed"), opposed=True),) if half_open else ()
    return Pattern(
        panels,
        seams + closing,
        boundary_loops=4 if half_open else 3,
        opening=(("right", "opening"), ("left", "opening")),
        flatness=flatness,
    )


def dress(rng: np.random.Generator) -> Pattern:
    """A bodice with a skirt cut in one piece (A-line) or sewn on as a sector; rims: neck, hem, two cuffs."""
    bodice = Bodice.sample(rng, sleeves=(0.40, 0.40, 0.20))
    waist_y, waist = -rng.uniform(0.36, 0.46), bodice.chest * rng.uniform(0.78, 1.0)
    skirt = rng.uniform(0.80, 1.42) + waist_y
    widening = rng.uniform(0.04, 0.42) * skirt / 0.7
    seams = back_to_back(*BODICE_SEAMS)
    if rng.random() < 0.5:
        side_height = np.sqrt(max(skirt**2 - 0.9 * widening**2, 0.01))
        side_end = (waist + widening, waist_y - side_height)
        panels = _front_and_back(bodice, line((waist, waist_y), side_end), _hem(side_end, skirt - side_height))
    else:
        panels = _front_and_back(bodice, line((waist, waist_y)), line((-waist, waist_y), (waist, waist_y)))
        sector = _sector(2 * waist, skirt, angle=max(0.15, 2 * widening / skirt), top=waist_y)
        panels |= {"front_skirt": Panel(sector, front=True), "back_skirt": Panel(sector, front=False)}
        seams += tuple(Seam((k, "hem"), (f"{k}_skirt", "waist"), opposed=True) for k in ("front", "back"))
        seams += tuple(Seam(("front_skirt", k), ("back_skirt", k)) for k in ("side_right", "side_left"))
    return Pattern(panels, seams, boundary_loops=4, flatness=rng.uniform(), lift_above=waist_y - 0.02)


def skirt(rng: np.random.Generator) -> Pattern:
    """Two equal sectors; rims: waist and hem."""
    waist, height = rng.uniform(0.66, 0.95) / 2, rng.uniform(0.40, 0.88)
    sector = _sector(waist, height, angle=rng.uniform(0.35, 1.65), top=0.0, dip=rng.uniform(-0.03, 0.05))
    return Pattern(
        panels={"front": Panel(sector, front=True), "back": Panel(sector, front=False)},
        seams=back_to_back("side_right", "side_left"),
        boundary_loops=2,
        flatness=0.3 * rng.uniform(),
        lift_above=np.inf,
    )


def jumpsuit(rng: np.random.Generator) -> Pattern:
    """Bodice and legs in one piece; rims: neck, two cuffs and two hems."""
    bodice = Bodice.sample(rng, sleeves=(0.62, 0.26, 0.12))
    legs = Legs.of_jumpsuit(rng, bodice.chest)
    below, bottom = legs.outer_seam(), legs.bottom()
    panels = {
        name: Panel(bodice.outline(name == "front", below, bottom), front=name == "front") for name in ("front", "back")
    }
    return Pattern(panels, back_to_back(*BODICE_SEAMS, *INSEAMS), boundary_loops=5, flatness=rng.uniform())


PATTERNS: dict[str, Callable[[np.random.Generator], Pattern]] = {
    "trousers": trousers,
    "tshirt": tshirt,
    "dress": dress,
    "skirt": skirt,
    "jumpsuit": jumpsuit,
}


def _hem(side_end: tuple[float, float], drop: float) -> Curve:
    """A parabola between the two side seams, `drop` lower in the middle, left to right."""
    t = np.linspace(-1.0, 1.0, 31)
    return np.column_stack([side_end[0] * t, side_end[1] - drop * (1 - t**2)])


def _front_and_back(bodice: Bodice, below: Curve, hem: Curve) -> dict[str, Panel]:
    return {
        name: Panel(bodice.outline(name == "front", below, {"hem": hem}), front=name == "front")
        for name in ("front", "back")
    }


def _sector(waist: float, height: float, angle: float, top: float, dip: float = 0.0) -> dict[str, Curve]:
    """A ring sector whose inner arc, `waist` long, touches y = `top`; the hem may dip in the middle."""
    inner = waist / angle
    upper = arc(inner, angle, centre_y=top + inner)
    lower = arc(inner + height, angle, centre_y=top + inner)
    lower[:, 1] -= dip * np.cos(np.linspace(-np.pi / 2, np.pi / 2, len(lower)))
    return {
        "hem": lower,
        "side_right": line(lower[-1], upper[-1]),
        "waist": upper[::-1],
        "side_left": line(upper[0], lower[0]),
    }


def _right_front(bodice: Bodice, below: Curve, hem: Curve, half_open: bool) -> dict[str, Curve]:
    """The right half of a front that opens along a slit in the middle."""
    neck = _right_of(bodice.neck_curve(front=True), SLIT)
    top, bottom = neck[0], hem[len(hem) // 2]
    sides = bodice.right_side(below)
    if not half_open:
        hem = _right_of(hem, SLIT)
        return {"hem": hem, **sides, "neck": neck[::-1], "opening": line(top, hem[0])}
    end = (top[1] + bottom[1]) / 2
    return {
        "hem": _right_of(hem, 0.0),
        **sides,
        "neck": neck[::-1],
        "opening": line(top, (SLIT, end + SLIT), (0.0, end)),
        "closed": line((0.0, end), bottom),
    }


def _right_of(curve: Curve, x: float) -> Curve:
    """The part of a left-to-right curve that lies right of `x`."""
    cut = (x, np.interp(x, curve[:, 0], curve[:, 1]))
    return np.vstack([cut, curve[curve[:, 0] > x + 1e-9]])
