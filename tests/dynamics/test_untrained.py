import numpy as np
import torch

from medor_dynamics.learned import learned
from medor_dynamics.preset import PRESETS
from medor_dynamics.shipped import load
from medor_dynamics.untrained import Options, main
from medor_wire.bus import Call


def test_untrained_weights_are_served_like_trained_ones(tmp_path, sheet, request_for):
    main(Options(tmp_path, "cpu"))
    assert load(tmp_path).preset == PRESETS["cpu"]
    mesh = sheet()
    pick = mesh.vertices[:1] + np.array([0, 0, 0.01], np.float32)
    rollouts = learned(tmp_path, 1, torch.float32).roll_out(request_for(mesh, pick, pick + np.float32(0.03)), Call())
    assert np.isfinite(rollouts.positions).all()
