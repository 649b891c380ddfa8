import logging

from medor_recon.networks import Networks
from medor_recon.reconstructor import Reconstructor
from medor_recon.warm_up import patch, warm_up
from medor_wire.messages import ReconstructRequest


def test_a_warmed_up_service_has_its_networks_loaded():
    networks = Networks()
    warm_up(Reconstructor(networks=networks))
    assert networks._canonicalizer.cache_info().currsize == 1
    assert networks._completion.cache_info().currsize == 1


def test_the_patch_is_a_garment_to_the_service():
    mesh = Reconstructor().reconstruct(ReconstructRequest(view=patch(), category="tshirt", method="visible")).mesh
    width = mesh.vertices[:, :2].max(axis=0) - mesh.vertices[:, :2].min(axis=0)
    assert (abs(width - 0.2) < 0.03).all()


def test_without_weights_it_is_no_failure(tmp_path, caplog):
    with caplog.at_level(logging.INFO):
        warm_up(Reconstructor(networks=Networks(tmp_path)))
    assert "no weights" in caplog.text
