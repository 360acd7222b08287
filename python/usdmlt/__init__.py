"""usdmlt renders USD scenes.

>>> import usdmlt
>>> image = usdmlt.render("scenes/cornell_box.usda", samples=64)
>>> image["color"].shape
(256, 256, 3)
>>> image.write("cornell.exr")

Everything public is here; submodules are imported when a name is first used.
"""

from __future__ import annotations

import importlib
import logging
import warnings
from typing import TYPE_CHECKING, Any

from usdmlt import cpu
from usdmlt._version import __version__

if TYPE_CHECKING:
    from usdmlt.errors import Error
    from usdmlt.image import Image
    from usdmlt.image import read as read_image
    from usdmlt.plain import Histogram, metropolis
    from usdmlt.rendering import Interrupted, Progress, Rendering, render
    from usdmlt.scene import Scene
    from usdmlt.settings import Settings
    from usdmlt.stage import load

__all__ = [
    "Error",
    "Histogram",
    "Image",
    "Interrupted",
    "Progress",
    "Rendering",
    "Scene",
    "Settings",
    "__version__",
    "load",
    "metropolis",
    "read_image",
    "render",
]

# Where each public name lives: module, and its name there.
_HOMES = {
    "Error": ("usdmlt.errors", "Error"),
    "Histogram": ("usdmlt.plain", "Histogram"),
    "Image": ("usdmlt.image", "Image"),
    "Interrupted": ("usdmlt.rendering", "Interrupted"),
    "Progress": ("usdmlt.rendering", "Progress"),
    "Rendering": ("usdmlt.rendering", "Rendering"),
    "Scene": ("usdmlt.scene", "Scene"),
    "Settings": ("usdmlt.settings", "Settings"),
    "load": ("usdmlt.stage", "load"),
    "metropolis": ("usdmlt.plain", "metropolis"),
    "read_image": ("usdmlt.image", "read"),
    "render": ("usdmlt.rendering", "render"),
}

_MODULES = ("color", "notebook", "views")

logging.getLogger("usdmlt").addHandler(logging.NullHandler())

_complaint = cpu.complaint()
if _complaint:
    warnings.warn(_complaint, RuntimeWarning, stacklevel=2)


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used: `import usdmlt` stays quick."""
    if name in _MODULES:
        return importlib.import_module(f"usdmlt.{name}")
    if name not in _HOMES:
        raise AttributeError(f"module 'usdmlt' has no attribute {name!r}")
    module, attribute = _HOMES[name]
    value = getattr(importlib.import_module(module), attribute)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(set(globals()) | set(__all__))
