"""UsdRenderPass: what its collections leave of a stage.

``prune`` takes its members away, and all below them. ``renderVisibility`` has what is rendered:
everything unless it says otherwise. The camera's own visibility and mattes are not followed, with a
warning. What is inside of instances that are alike is rendered, or not, as in the first of them.
"""

from __future__ import annotations

from pxr import Usd

from usdmlt.errors import Report
from usdmlt.stage.membership import is_authored

PRUNE, VISIBILITY = "prune", "renderVisibility"
IGNORED = ("cameraVisibility", "matte")


class PassVisibility:
    """What of a stage a pass renders; ``None`` for the pass: all of it."""

    def __init__(self, render_pass: Usd.Prim | None, report: Report):
        self._prune = self._visible = None
        if render_pass is None:
            return
        if is_authored(render_pass, PRUNE):
            self._prune = Usd.CollectionAPI(render_pass, PRUNE).ComputeMembershipQuery()
        if is_authored(render_pass, VISIBILITY):
            self._visible = Usd.CollectionAPI(render_pass, VISIBILITY).ComputeMembershipQuery()
        for name in IGNORED:
            if is_authored(render_pass, name):
                report.warn(
                    "camera visibility and mattes of render passes are ignored",
                    f"{render_pass.GetPath()} ({name})",
                )

    def prunes(self, prim: Usd.Prim) -> bool:
        """Whether a prim and all below it are taken away."""
        return self._prune is not None and self._prune.IsPathIncluded(prim.GetPath())

    def shows(self, prim: Usd.Prim) -> bool:
        """Whether a prim itself is rendered."""
        return self._visible is None or self._visible.IsPathIncluded(prim.GetPath())
