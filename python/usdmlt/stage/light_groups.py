"""Which group a light is of, for layers of light paths: by our own attribute, or by those of other
renderers."""

from __future__ import annotations

from collections.abc import Iterable

from pxr import Usd

ATTRIBUTES = (
    "primvars:usdmlt:lightGroup",
    "usdmlt:lightGroup",
    "inputs:karma:light:lpetag",
    "karma:light:lpetag",
    "inputs:ri:light:lightGroup",
    "ri:light:lightGroup",
    "primvars:arnold:aov",
)
# Of a mesh whose material glows.
GEOMETRY_ATTRIBUTES = (*ATTRIBUTES[:2], "primvars:karma:object:lpetag")


def light_group(prim: Usd.Prim, names: Iterable[str] = ATTRIBUTES) -> str:
    """The first that is authored; "" where there is none."""
    for name in names:
        attribute = prim.GetAttribute(name)
        value = attribute.Get() if attribute and attribute.HasAuthoredValue() else None
        if isinstance(value, str) and value:
            return value
    return ""
