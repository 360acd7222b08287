"""The medium that fills the world: the volume of the material that the render settings name."""

from __future__ import annotations

from pxr import Usd, UsdShade

from usdmlt.errors import Report
from usdmlt.scene import DistantLight, DomeLight, Light, Medium
from usdmlt.stage.bodies import interacts
from usdmlt.stage.materials import Materials
from usdmlt.stage.render_settings import RenderSettings
from usdmlt.stage.usdmlt_settings import WORLD_MEDIUM


def read_world_medium(
    stage: Usd.Stage, settings: RenderSettings, materials: Materials, report: Report
) -> int | None:
    """The index of the medium; None, with a warning where one is named that is none."""
    if settings.world_medium is None:
        return None
    prim = stage.GetPrimAtPath(settings.world_medium)
    medium = materials.volume_index(UsdShade.Material(prim)) if prim else None
    if medium is None:
        report.warn(
            f"{WORLD_MEDIUM} names no material with a volume",
            f"{settings.path} ({settings.world_medium})",
        )
        return None
    return medium


def warn_of_lost_light(medium: Medium, lights: list[Light], report: Report) -> None:
    """Nothing gets through infinitely much of a medium."""
    if not interacts(medium):
        return
    for light in lights:
        if isinstance(light, (DistantLight, DomeLight)):
            report.warn(
                "lights at infinity give no light where a medium fills the world", light.name
            )
