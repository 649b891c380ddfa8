"""A network as a folder: `weights.safetensors`, `config.json` (all it takes to build it), `card.md` (for people)."""

import json
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError
from safetensors.torch import load_file, save_file
from torch import Tensor, nn

from medor_learn.errors import WeightsError

WEIGHTS, CONFIG, CARD = "weights.safetensors", "config.json", "card.md"
LEARNT = ("data", "schedule", "metrics", "revision", "start")
"""What of a config tells how weights came about."""


def save(folder: Path, module: nn.Module, config: Mapping[str, Any], card: Mapping[str, Any]) -> None:
    """Write a network so that `load` needs nothing else; each file is replaced at once.

    Args:
        folder: made if need be.
        module: the network.
        config: what `build` takes, as JSON: preset, normaliser, seeds, revision, metrics.
        card: what a reader should know, heading by heading.
    """
    folder.mkdir(parents=True, exist_ok=True)
    state = {name: tensor.detach().cpu().contiguous() for name, tensor in module.state_dict().items()}
    _replace(folder / WEIGHTS, lambda path: save_file(state, path))
    _replace(folder / CONFIG, lambda path: path.write_text(json.dumps(config, indent=2) + "\n"))
    _replace(folder / CARD, lambda path: path.write_text(markdown(card)))


def load(
    folder: Path, build: Callable[[dict[str, Any]], nn.Module], device: str = "cpu"
) -> tuple[nn.Module, dict[str, Any]]:
    """The network of a folder, ready to use (float32, evaluation mode), and its config.

    Args:
        folder: written by `save`.
        build: makes the network, with any weights, from the config.
        device: where to put it.

    Raises:
        WeightsError: what is missing, superfluous, of another shape or unreadable.
    """
    config = read_config(folder)
    state = _read(folder)
    module = build(config)
    _check(folder, module.state_dict(), state)
    module.load_state_dict(state)
    return module.to(device).eval(), config


def start(module: nn.Module, folder: Path) -> dict[str, Any]:
    """Give a network the weights of a folder to go on from.

    Returns:
        What that folder says of how they were learnt, for the card of what comes of it.

    Raises:
        WeightsError: they do not fit.
    """
    config, state = read_config(folder), _read(folder)
    _check(folder, module.state_dict(), state)
    module.load_state_dict(state)
    return {name: config[name] for name in LEARNT if name in config}


def ship(folder: Path, to: Path) -> None:
    """Copy a folder to where it is published, half as large: matrices and kernels as float16.

    Vectors (biases, statistics of norms) stay as they are, and so does all else in the folder.

    Raises:
        WeightsError: it holds no network.
    """
    read_config(folder)
    state = {name: _halved(tensor) for name, tensor in _read(folder).items()}
    shutil.copytree(folder, to, dirs_exist_ok=True)
    _replace(to / WEIGHTS, lambda path: save_file(state, path))


def read_config(folder: Path) -> dict[str, Any]:
    """What a folder says about its network.

    Raises:
        WeightsError: there is none, or it is not JSON.
    """
    try:
        return json.loads((folder / CONFIG).read_text())
    except (OSError, json.JSONDecodeError) as error:
        raise WeightsError(f"{folder}: expected a folder of weights with a {CONFIG} ({error})") from error


def markdown(card: Mapping[str, Any]) -> str:
    """A card as a page: text as it is, anything else as JSON."""
    parts = [f"## {heading}\n\n{_prose(text)}\n" for heading, text in card.items()]
    return "\n".join(["# Model card\n", *parts])


def _read(folder: Path) -> dict[str, Tensor]:
    try:
        return load_file(folder / WEIGHTS)
    except (OSError, SafetensorError) as error:
        raise WeightsError(f"{folder / WEIGHTS}: expected a safetensors file ({error})") from error


def _prose(text: Any) -> str:
    return text if isinstance(text, str) else f"```json\n{json.dumps(text, indent=2)}\n```"


def _halved(tensor: Tensor) -> Tensor:
    return tensor.to(torch.float16) if tensor.is_floating_point() and tensor.ndim > 1 else tensor


def _replace(path: Path, write: Callable[[Path], Any]) -> None:
    partial = path.with_name(f".{path.name}.partial")
    write(partial)
    partial.chmod(0o644)
    partial.replace(path)


def _check(folder: Path, wanted: Mapping[str, Tensor], found: Mapping[str, Tensor]) -> None:
    faults = [f"{name} is missing" for name in sorted(wanted.keys() - found.keys())]
    faults += [f"{name} is unknown" for name in sorted(found.keys() - wanted.keys())]
    faults += [
        f"{name} has shape {tuple(found[name].shape)} instead of {tuple(wanted[name].shape)}"
        for name in sorted(wanted.keys() & found.keys())
        if found[name].shape != wanted[name].shape
    ]
    if faults:
        more = f" and {len(faults) - 3} more" if len(faults) > 3 else ""
        raise WeightsError(f"{folder} does not fit the network: {'; '.join(faults[:3])}{more}")
