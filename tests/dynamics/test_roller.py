import pytest

from medor_dynamics.physics import Physics
from medor_dynamics.roller import Roller
from medor_wire.bus import Call
from medor_wire.errors import BadRequest


def test_a_backend_that_is_not_here_is_said_so_with_those_that_are(sheet, request_for):
    mesh = sheet()
    request = request_for(mesh, mesh.vertices[:1], mesh.vertices[:1]).model_copy(update={"backend": "gnn"})
    with pytest.raises(BadRequest, match=r"physics.*'gnn'"):
        Roller({"physics": Physics(threads=1)}).roll_out(request, Call())


def test_the_named_backend_answers(sheet, request_for):
    mesh = sheet()
    request = request_for(mesh, mesh.vertices[:1], mesh.vertices[:1])
    assert len(Roller({"physics": Physics(threads=1)}).roll_out(request, Call()).rewards) == 1
