"""What tells renders apart whose units must not be summed: scene, settings, versions, plan.

How much is rendered, on how many threads and for how long is no part of it.
"""

from __future__ import annotations

import hashlib
import json
import struct
from dataclasses import asdict, fields, is_dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from usdmlt import native
from usdmlt._version import __version__

if TYPE_CHECKING:
    from collections.abc import Sequence

    from usdmlt.layers import Layer
    from usdmlt.scene import Scene
    from usdmlt.settings import Settings

Fingerprint = dict[str, Any]  # as JSON has it

_SETTINGS = (
    "depth",
    "seed",
    "filter",
    "error",
    "mutation_weights",
    "direct",
    "selective",
    "two_stage",
)


def of_machine(embree_isa: str) -> Fingerprint:
    """What has to be the same on all machines of a render."""
    return {
        "version": __version__,
        "instruction_set": native.build_info()["instruction_set"],
        "embree": f"{native.embree_version()} ({embree_isa})",
    }


def of_render(
    scene: Scene, settings: Settings, integrator: str, layers: Sequence[Layer], plan: int
) -> Fingerprint:
    """Of a planned render. ``plan``: the core's own number for it, by the last bits of what pilots
    measured."""
    own = {name: getattr(settings, name) for name in _SETTINGS}
    own["integrator"] = integrator
    own["aovs"] = [asdict(layer) for layer in layers]
    fingerprint = of_machine(settings.embree_isa)
    fingerprint |= {"scene": scene_digest(scene), "settings": own, "plan": f"{plan:016x}"}
    result: Fingerprint = json.loads(json.dumps(fingerprint))  # as it will be read again
    return result


def difference(found: Fingerprint, expected: Fingerprint) -> str | None:
    """In what the first differs from the second, in words; None: in nothing."""
    for key, what in (
        ("version", "usdmlt {}"),
        ("instruction_set", "a build for {}"),
        ("embree", "Embree {}"),
    ):
        a, b = found.get(key), expected.get(key)
        if a != b:
            return f"it is of {what.format(a)}, not {what.format(b).removeprefix('a build for ')}"
    theirs, ours = found.get("settings", {}), expected.get("settings", {})
    for name in dict.fromkeys([*ours, *theirs]):
        if theirs.get(name) != ours.get(name):
            if name == "aovs":
                return "it has other layers"
            return f"its {name} is {theirs.get(name)}, not {ours.get(name)}"
    if found.get("scene") != expected.get("scene"):
        return "it is of another scene, size or frame"
    if found.get("plan") != expected.get("plan"):
        return "its pilots measured something else, as they do on another kind of machine"
    return None if found == expected else "it is of another plan"


def scene_digest(scene: Scene) -> str:
    """Of all that is rendered: where the stage was read from, and what it asks for, is left
    out."""
    digest = hashlib.sha256()
    for field in fields(scene):
        if field.name not in ("metadata", "settings"):
            digest.update(field.name.encode())
            _update(digest, getattr(scene, field.name))
    _update(digest, repr(scene.metadata.get("data_window")))
    return digest.hexdigest()


def _update(digest: Any, value: Any) -> None:
    """Each kind of value begins with a letter of its own and, if it has parts, their number."""
    if isinstance(value, np.ndarray):
        digest.update(f"a{value.dtype.str}{value.shape}".encode())
        digest.update(np.ascontiguousarray(value).data)
    elif isinstance(value, (bool, np.bool_)) or value is None:
        digest.update(f"b{value}".encode())
    elif isinstance(value, (int, np.integer)):
        digest.update(f"i{value};".encode())
    elif isinstance(value, (float, np.floating)):
        digest.update(b"f" + struct.pack("<d", value))
    elif isinstance(value, str):
        digest.update(f"s{len(value)};{value}".encode())
    elif isinstance(value, (list, tuple)):
        digest.update(f"l{len(value)};".encode())
        for item in value:
            _update(digest, item)
    elif isinstance(value, (set, frozenset)):
        _update(digest, sorted(value))
    elif isinstance(value, dict):
        digest.update(f"d{len(value)};".encode())
        for key in sorted(value, key=repr):
            _update(digest, key)
            _update(digest, value[key])
    elif is_dataclass(value):
        digest.update(f"c{type(value).__name__};".encode())
        for field in fields(value):
            _update(digest, getattr(value, field.name))
    else:
        raise TypeError(f"a scene has no {type(value).__name__}")
