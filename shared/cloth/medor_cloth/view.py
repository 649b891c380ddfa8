"""Show any cloth: a mesh file, a saved state or rollout, a sample of a data set, a generated garment.

examples:
  medor view garment.obj                              a picture from the side
  medor view garment.obj --out turn.gif               one turn around it
  medor view state.npz --out x.png                    arrays `positions` (V,3) or (T,V,3) and `faces`
  medor view data/recon/tshirt --index 3 --out x.gif  a trajectory, state by state
  medor view --category tshirt --seed 4 --state drop
  medor view data/dynamics/trousers --interactive     a page to turn and play it (needs the extra `viewer`)
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from medor_cloth.camera import Camera
from medor_cloth.errors import ClothError
from medor_cloth.film import gif_bytes, png_sheet_bytes
from medor_cloth.footage import STARTS, Footage, load, of_garment
from medor_cloth.garment import CATEGORIES, generate
from medor_cloth.portrait import captioned, portrait, with_arrow
from medor_cloth.viewpoint import above, around, turns

STILL_S = 1.0
"""Time each of several states that are no motion is shown [s]."""
SLOWER = 3.0
"""How much slower than life a motion is shown."""
TURN_FRAMES, TURN_S = 36, 0.08
ELEVATION_DEG, WORN_ELEVATION_DEG = 38.0, 15.0
"""Height of the side view over the horizon, of cloth on the table and of worn garments."""
VIEWS = ("both", "top", "side")


def write(footage: Footage, out: Path, view: str = "both", width: int = 480) -> None:
    """Writes `.png` (states side by side, row by row) or `.gif` (states in turn; one turn around a single one).

    Raises:
        ClothError: any other ending, or a file that cannot be written.
    """
    kind = out.suffix.lower()
    if kind not in (".png", ".gif"):
        raise ClothError(f"expected a name ending in .gif or .png, got {out.name}")
    around_it = kind == ".gif" and len(footage.states) == 1
    shots = turn(footage, width) if around_it else pictures(footage, view, width)
    seconds = TURN_S if around_it else SLOWER * footage.seconds or STILL_S
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        out.write_bytes(gif_bytes(shots, seconds) if kind == ".gif" else png_sheet_bytes(shots))
    except OSError as error:
        raise ClothError(f"cannot write {out}: {error.strerror}") from error


def pictures(footage: Footage, view: str, width: int) -> list[NDArray[np.uint8]]:
    """A numbered picture of each state, all from the same places: from above, from the side, or both beside each other.

    A worn garment is shown from the side unless another view is asked for by name.
    """
    top, side = above(footage.states, width), around(footage.states, width, _elevation(footage))
    views = {"top": [top], "side": [side], "both": [side] if footage.worn else [top, side]}
    return [_picture(footage, number, views[view]) for number in range(len(footage.states))]


def turn(footage: Footage, width: int) -> list[NDArray[np.uint8]]:
    """One turn around the first state."""
    return [
        _picture(footage, 0, [camera]) for camera in turns(footage.states[0], width, TURN_FRAMES, _elevation(footage))
    ]


def _elevation(footage: Footage) -> float:
    return WORN_ELEVATION_DEG if footage.worn else ELEVATION_DEG


def _picture(footage: Footage, number: int, cameras: Sequence[Camera]) -> NDArray[np.uint8]:
    shots = [portrait(footage.states[number], footage.faces, one, table=not footage.worn) for one in cameras]
    if footage.moves is not None:
        move = footage.moves[number]
        shots = [with_arrow(shot, move, one) for shot, one in zip(shots, cameras, strict=True)]
    shots[0] = captioned(shots[0], footage.caption(number))
    return np.concatenate(shots, axis=1)


def main(words: Sequence[str] | None = None) -> None:
    """Shows what the command line asks for."""
    options = _parser().parse_args(words)
    try:
        footage = _asked(options)
        if options.interactive:
            from medor_cloth.stage import perform

            perform(footage, options.port)
            return
        out = options.out or Path(f"{footage.name.replace(' ', '-')}.{'gif' if len(footage.states) > 1 else 'png'}")
        write(footage, out, options.view, options.width)
        sys.stderr.write(f"{out}: {footage.summary}\n")
    except ClothError as error:
        sys.exit(f"medor view: {error}")
    except KeyboardInterrupt:
        sys.exit(130)


def _asked(options: argparse.Namespace) -> Footage:
    if options.category is None or options.seed is None:
        if options.source is None:
            raise ClothError("nothing to show: name a file or a data set, or a garment with --category and --seed")
        return load(options.source, options.index)
    if options.source is None:
        return of_garment(options.category, options.seed, options.state, options.edge_m)
    return load(options.source, options.index, generate(options.category, options.seed, options.edge_m))


def _parser() -> argparse.ArgumentParser:
    about, examples = (__doc__ or "").split("\n\n", 1)
    parser = argparse.ArgumentParser(
        "medor view", description=about, epilog=examples, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("source", nargs="?", type=Path, help="mesh file, .npz, .npy or folder of a data set")
    add("--index", type=int, default=0, help="of a trajectory in a data set")
    add(
        "--category", choices=CATEGORIES, help="of a garment to make (with --seed), or that a state without faces is of"
    )
    add("--seed", type=int, help="of that garment, and of its crumpling")
    add("--state", choices=STARTS, default="worn", help="of a garment to make")
    add("--edge-m", type=float, default=0.012, help="mean edge length of a garment to make [m]")
    add("--out", type=Path, help=".png (states row by row) or .gif (in turn; one turn around a single state)")
    add("--view", choices=VIEWS, default="both", help="from above, from the side, or both")
    add("--width", type=_width, default=480, help="of a view [px]")
    add("--interactive", action="store_true", help="serve a page instead of writing a file (extra `viewer`)")
    add("--port", type=int, default=8090, help="of that page")
    return parser


def _width(text: str) -> int:
    width = int(text)
    if not 16 <= width <= 4096:
        raise argparse.ArgumentTypeError(f"expected 16 to 4096 pixels, got {text}")
    return width


if __name__ == "__main__":
    main()
