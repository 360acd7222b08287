"""MaterialX nodes that compute: names and defaults of their inputs, and their values, against
MaterialX's library."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose

from support.scattering import probe_material
from usdmlt.scene import PrimvarInput
from usdmlt.stage import load
from usdmlt.stage.color import ColorSpaces
from usdmlt.stage.materialx_nodes import LUMA, NAME, OPERATIONS, reader
from usdmlt.stage.networks import Source

mx = pytest.importorskip("MaterialX", reason="the extra `materialx` is not installed")


@cache
def library():
    document = mx.createDocument()
    mx.loadLibraries(mx.getDefaultDataLibraryFolders(), mx.getDefaultDataSearchPath(), document)
    return document


DEFINITIONS = sorted(
    definition.getName()
    for definition in library().getNodeDefs()
    if (match := NAME.fullmatch(definition.getName()))
    and match["category"] in OPERATIONS
    # Of a category that is read, but with types that are not: matrices, BSDFs.
    and not any(t in definition.getName() for t in ("matrix", "bsdf", "edf", "vdf", "string"))
    and not any(t in definition.getName() for t in ("filename", "material", "shader"))
)


class Recorder:
    """Stands for networks and shader: every input has its default, and is written down."""

    def __init__(self) -> None:
        self.asked: dict[str, object] = {}
        self.report = self
        self.colors = ColorSpaces()

    def read(self, shader, name, default, kind):
        self.asked[name] = default
        return default

    value = number = lambda self, shader, name, default: self.read(shader, name, default, "")

    def GetPath(self) -> str:
        return "/shader"


@pytest.mark.parametrize("name", DEFINITIONS)
def test_inputs_are_named_and_default_as_in_the_library(name):
    read = reader(name)
    if read is None:  # noise of several lanes
        assert name.split("_")[1] in ("noise2d", "noise3d", "fractal3d")
        return
    recorder = Recorder()

    class Node(Source):
        node = name

    outputs = [output.getName() for output in library().getNodeDef(name).getOutputs()]
    for output in outputs:
        read(recorder, Node(None, recorder, output), "value")
    inputs = {i.getName(): i for i in library().getNodeDef(name).getActiveInputs()}
    for asked, default in recorder.asked.items():
        assert asked in inputs, f"{name} has no input {asked}"
        value = inputs[asked].getValue()
        if inputs[asked].hasDefaultGeomPropString() or isinstance(value, str):
            continue
        expected = np.array(value if np.ndim(value) == 0 else tuple(value), np.float64)
        if default is None or isinstance(default, PrimvarInput):
            continue
        given = np.asarray(default, np.float64)
        if given.size > 1 and expected.size > given.size:  # the alpha of a colour of four
            expected = expected[: given.size]
        if name.endswith("4") or "color4" in name:
            expected = expected[:3] if expected.size == 4 else expected
        assert_allclose(np.broadcast_to(given, expected.shape), expected, err_msg=asked)


COLOR = '<input name="NAME" type="color3" nodename="base" />'
ST = '<input name="texcoord" type="vector2" nodename="st" />'


def _(name: str, type_name: str, value: str) -> str:
    return f'<input name="{name}" type="{type_name}" value="{value}" />'


GRAPHS = {
    "contrast": ("color3", COLOR.replace("NAME", "in") + _("amount", "color3", "1.5, 2, 0.5")),
    "range": (
        "color3",
        COLOR.replace("NAME", "in")
        + _("inlow", "color3", "0.1, 0.1, 0.1")
        + _("inhigh", "color3", "0.9, 0.8, 0.7")
        + _("gamma", "color3", "2, 1.5, 0.7")
        + _("outlow", "color3", "0.2, 0.2, 0.2")
        + _("outhigh", "color3", "0.6, 0.7, 0.8")
        + _("doclamp", "boolean", "true"),
    ),
    "saturate": ("color3", COLOR.replace("NAME", "in") + _("amount", "float", "0.3")),
    "hsvadjust": ("color3", COLOR.replace("NAME", "in") + _("amount", "vector3", "0.2, 0.5, 1.5")),
    "smoothstep": ("color3", COLOR.replace("NAME", "in") + _("high", "color3", "0.5, 0.7, 0.9")),
    "switch": (
        "color3",
        COLOR.replace("NAME", "in2") + _("which", "float", "1") + _("in1", "color3", "0, 0, 1"),
    ),
    "ramp4": (
        "color3",
        ST
        + _("valuetl", "color3", "0.1, 0.2, 0.3")
        + _("valuetr", "color3", "0.9, 0.2, 0.3")
        + _("valuebl", "color3", "0.1, 0.8, 0.3")
        + _("valuebr", "color3", "0.5, 0.4, 0.9"),
    ),
    "checkerboard": ("color3", ST + _("uvtiling", "vector2", "3, 5")),
    "place2d": (
        "vector2",
        ST
        + _("pivot", "vector2", "0.5, 0.4")
        + _("scale", "vector2", "0.7, 1.3")
        + _("rotate", "float", "30")
        + _("offset", "vector2", "-0.9, -0.8"),
    ),
}
SURFACE = """<?xml version="1.0"?>
<materialx version="1.39">
  <geompropvalue name="base" type="color3"><input name="geomprop" type="string" value="c" />
  </geompropvalue>
  <texcoord name="st" type="vector2" />
  <CATEGORY name="node" type="TYPE">INPUTS</CATEGORY>
  CONVERT
  <uniform_edf name="edf" type="EDF">
    <input name="color" type="color3" nodename="LAST" />
  </uniform_edf>
  <surface name="surface" type="surfaceshader">
    <input name="edf" type="EDF" nodename="edf" />
  </surface>
  <surfacematerial name="M" type="material">
    <input name="surfaceshader" type="surfaceshader" nodename="surface" />
  </surfacematerial>
</materialx>
"""
CONVERT = """<convert name="last" type="color3">
    <input name="in" type="vector2" nodename="node" /></convert>"""
STAGE = """
def Scope "MaterialX" ( references = @m.mtlx@</MaterialX> ) { }
def Cube "c" (prepend apiSchemas = ["MaterialBindingAPI"])
{ rel material:binding = </MaterialX/Materials/M> }
"""


PLACES = (
    ((0.2, 0.3), (0.2, 0.4, 0.6)),
    ((0.7, 0.3), (0.9, 0.5, 0.3)),
    ((0.6, 0.8), (0.35, 0.75, 0.7)),
)


def emitted(folder, write, category: str, type_name: str, inputs: str, flatten: bool = False):
    """What a node gives at the places, shown as emission; flattened: the library's graph of it."""
    text = SURFACE.replace("CATEGORY", category).replace("TYPE", type_name)
    is_color = type_name == "color3"
    text = text.replace("INPUTS", inputs).replace("CONVERT", "" if is_color else CONVERT)
    document = mx.createDocument()
    mx.readFromXmlString(document, text.replace("LAST", "node" if is_color else "last"))
    document.setDataLibrary(library())
    if flatten:
        document.flattenSubgraphs("", lambda node: node.getCategory() == category)
        left = document.getNode("node")
        assert left is None or left.getCategory() != category
    mx.writeToXmlFile(document, str(folder / "m.mtlx"))
    scene = load(write(STAGE))
    material = next(m for m in scene.materials if m.name.endswith("M"))
    found = []
    for st, color in PLACES:
        primvars = {"st": np.tile(st, (3, 1)), "c": np.tile(color, (3, 1))}
        found.append(probe_material(material, scene.textures, primvars).emission)
    return np.array(found)


@pytest.mark.parametrize("category", GRAPHS)
def test_nodes_compute_what_materialxs_graphs_of_them_compute(tmp_path, write, category):
    ours = emitted(tmp_path, write, category, *GRAPHS[category])
    theirs = emitted(tmp_path, write, category, *GRAPHS[category], flatten=True)
    assert theirs.max() > 0.05
    assert_allclose(ours, theirs, rtol=2e-5, atol=1e-6)


LEFT, RIGHT = np.array([0.0, 0.3, 1.0]), np.array([1.0, 0.9, 0.1])
BOTH = _("value0", "color3", "0, 0.3, 1") + _("value1", "color3", "1, 0.9, 0.1")
BACKGROUND = np.array([0.3, 0.4, 0.5])
OVER = COLOR.replace("NAME", "fg") + _("bg", "color3", "0.3, 0.4, 0.5")
FORMULAS = {
    "ramplr": (ST + BOTH, "lr", lambda s, t, c: LEFT * (1 - s) + RIGHT * s),
    "ramptb": (ST + BOTH, "bt", lambda s, t, c: LEFT * (1 - t) + RIGHT * t),
    "splitlr": (ST + BOTH, "lr", lambda s, t, c: LEFT if s < 0.5 else RIGHT),
    "splittb": (ST + BOTH, "bt", lambda s, t, c: LEFT if t < 0.5 else RIGHT),
    "plus": (OVER, "", lambda s, t, c: c + BACKGROUND),
    "minus": (OVER, "", lambda s, t, c: np.maximum(BACKGROUND - c, 0)),
    "difference": (OVER, "", lambda s, t, c: np.abs(BACKGROUND - c)),
    "screen": (OVER, "", lambda s, t, c: 1 - (1 - c) * (1 - BACKGROUND)),
    "remap": (
        COLOR.replace("NAME", "in")
        + _("inlow", "color3", "0.1, 0.1, 0.1")
        + _("outhigh", "color3", "0.5, 0.5, 0.5"),
        "",
        lambda s, t, c: (c - 0.1) / 0.9 * 0.5,
    ),
    "luminance": (COLOR.replace("NAME", "in"), "", lambda s, t, c: np.full(3, c @ LUMA)),
}


@pytest.mark.parametrize("category", FORMULAS)
def test_nodes_without_graphs_compute_their_formulas(tmp_path, write, category):
    inputs, ends, formula = FORMULAS[category]
    for i, end in enumerate(ends):
        inputs = inputs.replace(f"value{i}", f"value{end}")
    expected = [formula(*st, np.array(color)) for st, color in PLACES]
    ours = emitted(tmp_path, write, category, "color3", inputs)
    assert_allclose(ours, expected, rtol=2e-5, atol=1e-6)
