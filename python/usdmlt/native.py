"""The one door to the compiled core, `usdmlt._core`."""

from __future__ import annotations

from functools import cache
from types import ModuleType
from typing import TYPE_CHECKING, Any

from usdmlt import cpu, embree
from usdmlt.errors import Error
from usdmlt.media import check_media

if TYPE_CHECKING:
    from usdmlt import _core
    from usdmlt.light_path_layers import LightPathLayers
    from usdmlt.scene import Scene
    from usdmlt.settings import ResolvedIntegrator, Settings


def core() -> ModuleType:
    """Import the compiled core; :class:`usdmlt.Error` where it cannot run or was not built."""
    complaint = cpu.complaint()
    if complaint:
        raise Error(complaint)
    try:
        from usdmlt import _core
    except ImportError as error:
        raise Error(f"the compiled core of usdmlt cannot be loaded: {error}") from error
    return _core


@cache
def surfaces() -> Any:
    """The part of the core that makes triangles of polygons and subdivision surfaces."""
    return core().surfaces


def build_scene(scene: Scene, embree_isa: str) -> _core.Scene:
    """Hand a scene description to the core and build its acceleration structures."""
    library = str(embree.find_library())
    try:
        check_media(scene)
        built: _core.Scene = core().Scene(scene, library, embree_isa)
    except (RuntimeError, ValueError) as error:
        raise Error(str(error)) from error
    return built


def plan_render(
    scene: _core.Scene,
    settings: Settings,
    integrator: ResolvedIntegrator,
    layers: LightPathLayers | None = None,
) -> _core.Render:
    """Plan the render of a built scene by one integrator: nothing is rendered yet."""
    try:
        planned: _core.Render = core().Render(
            scene,
            integrator=integrator,
            samples=settings.resolved_samples,
            depth=settings.depth,
            seed=settings.seed,
            filter=settings.filter,
            direct=settings.direct,
            selective=settings.selective,
            two_stage=settings.two_stage,
            mutation_weights=settings.mutation_weights or {},
            error_layer=settings.error,
            layers=layers,
        )
    except RuntimeError as error:
        raise Error(str(error)) from error
    return planned


def build_info() -> dict[str, Any]:
    """How the core was built: compiler, instruction set, version."""
    info: dict[str, Any] = core().build_info()
    return info


def embree_version() -> str:
    """The version of the Embree library that renders would use."""
    library = str(embree.find_library())
    try:
        return str(core().embree_version(library))
    except RuntimeError as error:
        raise Error(str(error)) from error
