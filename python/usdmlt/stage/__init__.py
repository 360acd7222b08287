"""USD stages into the scene description: the only part of usdmlt that imports pxr.

One module per schema family. The way through them is ``loading``: open the stage, walk it
(``traversal``, ``instancing``), read gprims (``geometry``), materials, lights and the camera.
"""

from usdmlt.stage.inspection import Inspection, inspect
from usdmlt.stage.loading import camera_paths, load, products

__all__ = ["Inspection", "camera_paths", "inspect", "load", "products"]
