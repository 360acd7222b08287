"""Where Embree is: inside the wheel of the package `embreex`, which carries the whole library.

The core loads the library at run time from the path found here; there is no Embree to install.
"""

from __future__ import annotations

import os
import re
from importlib import metadata
from pathlib import Path

from usdmlt.errors import Error

# Linux: embreex.libs/libembree4-4aef3270.so.4 (its RPATH finds the libtbb beside it),
# macOS: embreex/.dylibs/libembree4.4.dylib, Windows: embreex.libs/embree4.dll.
_LIBRARY = re.compile(r"(?:.*/)?(?:lib)?embree4[^/]*?(?:\.so[.\d]*|\.dylib|\.dll)")

_REMEDY = "`pip install embreex`, or set USDMLT_EMBREE to the path of an Embree 4 library"


def find_library() -> Path:
    """The path of the Embree 4 library: `USDMLT_EMBREE` if set, else the one in embreex's wheel.

    Embreex itself is not imported. Raises :class:`usdmlt.Error` when there is none.
    """
    override = os.environ.get("USDMLT_EMBREE")
    if override:
        path = Path(override)
        if not path.is_file():
            raise Error(f"USDMLT_EMBREE names {override}, which is not a file")
        return path.resolve()
    try:
        embreex = metadata.distribution("embreex")
    except metadata.PackageNotFoundError:
        raise Error(f"Embree was not found: {_REMEDY}") from None
    for file in embreex.files or ():
        if _LIBRARY.fullmatch(file.as_posix()):
            path = Path(str(embreex.locate_file(file)))
            if path.is_file():
                return path.resolve()
    raise Error(f"the installed embreex {embreex.version} contains no Embree 4: {_REMEDY}")
