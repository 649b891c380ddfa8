"""Test-time finetuning: the vertices of a completed mesh moved onto what was observed (MEDOR, section IV-B)."""

from medor_recon.refine.config import HELD, ISOMETRIC, JOINT, NO_CONSISTENCY, PAPER, Phase, RefineConfig
from medor_recon.refine.finetune import Refined, refine

__all__ = ["HELD", "ISOMETRIC", "JOINT", "NO_CONSISTENCY", "PAPER", "Phase", "RefineConfig", "Refined", "refine"]
