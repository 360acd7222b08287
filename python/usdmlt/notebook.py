"""Pictures in a Jupyter notebook, which grow while they are rendered.

>>> from usdmlt.notebook import Live
>>> image = usdmlt.render("shot.usda", samples=1024, preview=Live())
"""

from __future__ import annotations

from typing import Any

from usdmlt.errors import Error
from usdmlt.image import Image


class Live:
    """Shows a picture in the output of the cell, and the next ones in its place.

    ``view``: as of :meth:`usdmlt.Image.write`. Raises :class:`usdmlt.Error` without IPython.
    """

    def __init__(self, view: str = "sRGB") -> None:
        try:
            from IPython.display import display
        except ImportError:
            raise Error(
                "pictures in a notebook need IPython: pip install 'usdmlt[notebook]'"
            ) from None
        self.view = view
        self._display = display
        self._handle: Any = None

    def __call__(self, image: Image) -> None:
        """Show it."""
        data = {"image/png": image.png(self.view), "text/plain": _text(image)}
        if self._handle is None:
            self._handle = self._display(data, raw=True, display_id=True)
        else:
            self._handle.update(data, raw=True)


def _text(image: Image) -> str:
    spent = image.stats.get("samples_per_pixel", 0.0)
    digits = 0 if spent >= 100 or spent == round(spent) else 1
    return f"{image.width}x{image.height}, {spent:.{digits}f} samples per pixel"
