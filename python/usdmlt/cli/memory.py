"""`--memstats`: the memory that a picture took, as usdrecord has it for USD alone."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import fields, is_dataclass

import numpy as np

from usdmlt.scene import Scene


def memory_report(scene: Scene) -> str:
    """One line: the process's peak, and the arrays of a scene; those that are shared count once.

    The core keeps geometry a second time, in its own precision and with what rays need to find it;
    both are in the peak.
    """
    parts = {
        "geometry": (scene.meshes, scene.prototypes),
        "instances": scene.instances,
        "textures": scene.textures,
    }
    sizes = ", ".join(f"{name} {_mib(array_bytes(content))}" for name, content in parts.items())
    peak = peak_memory()
    return f"memory: {sizes}" + ("" if peak is None else f"; peak of the process {_mib(peak)}")


def array_bytes(content: object) -> int:
    """Bytes of the arrays that content of a scene description holds."""
    return sum({id(array): array.nbytes for array in _arrays(content)}.values())


def peak_memory() -> int | None:
    """Bytes of memory that the process has had at most; None where the system does not say."""
    try:
        import resource
    except ImportError:  # Windows
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else 1024 * peak


def _arrays(content: object) -> Iterator[np.ndarray]:
    if isinstance(content, np.ndarray):
        yield content
    elif isinstance(content, dict):
        yield from _arrays(tuple(content.values()))
    elif isinstance(content, (list, tuple)):
        for item in content:
            yield from _arrays(item)
    elif is_dataclass(content):
        for field in fields(content):
            yield from _arrays(getattr(content, field.name))


def _mib(size: int) -> str:
    return f"{size / 2**20:.1f} MiB"
