"""Teach the networks of reconstruction."""

import sys

import tyro

from medor_cloth.errors import ClothError
from medor_learn.errors import LearnError
from medor_recon.train.canonical import canonical
from medor_recon.train.completion import completion

COMMANDS = {"canonical": canonical, "completion": completion}


def main() -> None:
    try:
        tyro.extras.subcommand_cli_from_dict(COMMANDS, prog="medor_recon.train", description=__doc__)
    except (ClothError, LearnError) as error:
        sys.exit(f"train: {error}")


if __name__ == "__main__":
    main()
