"""`/meshes/*`: the mesh a plan was made on, for any viewer."""

from typing import Literal

from fastapi import APIRouter, Response

from medor_gateway.auth import READ
from medor_gateway.door import DoorOf
from medor_gateway.media import mesh_file
from medor_gateway.problem import documented

router = APIRouter(tags=["meshes"])

MEDIA_TYPES = {"glb": "model/gltf-binary", "ply": "application/x-ply"}


@router.get(
    "/meshes/{mesh_id}.{file_type}",
    dependencies=[READ],
    response_class=Response,
    responses={200: {"content": {kind: {} for kind in MEDIA_TYPES.values()}}} | documented(404, 422),
)
def mesh(mesh_id: str, file_type: Literal["glb", "ply"], door: DoorOf) -> Response:
    """A mesh: `.glb` (y up, as glTF has it) or `.ply` (task space, z up); metres. Blue where the camera saw it."""
    return Response(mesh_file(door.meshes.get(mesh_id), file_type), media_type=MEDIA_TYPES[file_type])
