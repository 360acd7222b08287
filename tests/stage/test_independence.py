"""The scene description holds nothing of USD, and USD is imported for stages only."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import fields, is_dataclass

import numpy as np


def everything(node):
    """All values below a dataclass, arrays' bases included."""
    yield node
    if isinstance(node, np.ndarray) and node.base is not None:
        yield from everything(node.base)
    elif is_dataclass(node):
        for field in fields(node):
            yield from everything(getattr(node, field.name))
    elif isinstance(node, dict):
        for item in (*node.keys(), *node.values()):
            yield from everything(item)
    elif isinstance(node, (list, tuple)):
        for item in node:
            yield from everything(item)


def test_no_value_of_a_scene_belongs_to_usd(read):
    scene = read("""
        def Camera "camera" { float fStop = 2
            float focusDistance = 3 }
        def Mesh "m" { QUAD
            normal3f[] normals = [(0, 0, 1), (0, 0, 1), (0, 0, 1), (0, 0, 1)]
            color3f[] primvars:displayColor = [(1, 0, 0)] ( interpolation = "constant" ) }
        def PointInstancer "i" {
            point3f[] positions = [(0, 0, 0), (5, 0, 0)]
            int[] protoIndices = [0, 0]
            rel prototypes = </i/s>
            def Sphere "s" {} }
        def RectLight "l" (prepend apiSchemas = ["ShapingAPI"]) {}
        def DomeLight "d" {}""")
    modules = {type(value).__module__.split(".")[0] for value in everything(scene)}
    assert modules <= {"builtins", "numpy", "usdmlt"}


def test_the_scene_description_does_not_import_usd():
    code = "import sys, usdmlt.scene; assert 'pxr' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)
