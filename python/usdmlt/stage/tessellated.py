"""The prim types that are made into meshes as finely as the picture shows them."""

from __future__ import annotations

from collections.abc import Callable

from pxr import Usd

from usdmlt.errors import Report
from usdmlt.scene import Mesh
from usdmlt.stage.curves import read_curves
from usdmlt.stage.detail import Detail
from usdmlt.stage.patches import read_nurbs_patch, read_tet_mesh
from usdmlt.stage.points import read_point_mesh
from usdmlt.stage.primvars import Spreads

Reader = Callable[[Usd.Prim, Usd.TimeCode, Detail, Report], "tuple[Mesh, Spreads] | None"]

READERS: dict[str, Reader] = {
    "BasisCurves": read_curves,
    "HermiteCurves": read_curves,
    "NurbsCurves": read_curves,
    "NurbsPatch": read_nurbs_patch,
    "Points": read_point_mesh,
    "TetMesh": read_tet_mesh,
}
