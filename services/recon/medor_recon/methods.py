"""Methods that complete what is hidden: named choices of networks and finetuning; MEDOR and its ablations."""

from dataclasses import dataclass

from medor_recon.refine import HELD, ISOMETRIC, JOINT, NO_CONSISTENCY, PAPER, RefineConfig


@dataclass(frozen=True)
class Method:
    """One way from a view to a whole mesh."""

    name: str
    canonical: str = "cpu"
    """Preset of the canonicalisation network."""
    completion: str = "cpu"
    """Preset of the completion."""
    refine: RefineConfig | None = PAPER
    """None: no finetuning."""


METHODS = {
    method.name: method
    for method in (
        Method("medor"),
        Method("no-finetuning", refine=None),
        Method("joint", refine=JOINT),
        Method("no-consistency", refine=NO_CONSISTENCY),
        Method("held", refine=HELD),
        Method("isometric", refine=ISOMETRIC),
        Method("field", completion="paper-small"),
        Method("field-no-finetuning", completion="paper-small", refine=None),
        Method("no-relative", completion="paper-small-no-relative", refine=None),
        Method("garmentnets", canonical="garmentnets-small", completion="paper-small-no-relative", refine=None),
    )
}
"""`medor` and its ablations (MEDOR, section V-D): `joint`, `no-consistency` and `no-finetuning` differ from it in
finetuning alone; `no-relative` from `field-no-finetuning` in what the warp is relative to. `held` finetunes with the
edge prior, `isometric` from a layout that keeps lengths; `garmentnets` is the baseline: PointNet++, absolute positions,
no finetuning."""
