"""MaterialX nodes that compute: arithmetic, colour, channels, placement, ramps, noise.

Every entry of :data:`OPERATIONS` is one node category, whatever its types: it takes a
:class:`Call` and returns an input of the scene description. Input names and defaults are those of
MaterialX's standard library; a test compares them with it.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from pxr import UsdLux

from usdmlt.scene import Input, PrimvarInput
from usdmlt.stage.color import DEFAULT
from usdmlt.stage.expressions import is_constant, lane, operate, plain
from usdmlt.stage.networks import Kind, Networks, Source

WIDTHS = {
    "float": 1,
    "integer": 1,
    "boolean": 1,
    "vector2": 2,
    "color3": 3,
    "vector3": 3,
    "color4": 4,
    "vector4": 4,
}
TYPE = "|".join(WIDTHS)
LUMA = (0.2722287, 0.6740818, 0.0536895)  # of AP1: the standard library's default weights


@dataclass
class Call:
    """A node while it is read: its inputs by name, and the type and name of its output."""

    networks: Networks
    source: Source
    type: str
    from_type: str = ""  # ND_convert, ND_separate: the type of the input

    @property
    def width(self) -> int:
        return WIDTHS[self.type]

    def input(self, name: str, default: Any = 0.0) -> Input:
        return self.networks.read(self.source.shader, name, default, "value")

    def number(self, name: str, default: float) -> float:
        """An input that must be constant."""
        return self.networks.number(self.source.shader, name, default)

    def texcoord(self) -> Input:
        return self.networks.read(self.source.shader, "texcoord", PrimvarInput("st"), "value")

    def position(self) -> Input:
        return self.input("position", operate("position"))

    def operate(self, operation: str, *inputs: Any, data: int = 0) -> Input:
        return operate(operation, *inputs, width=self.width, data=data)


Reader = Callable[[Call], Input]


def simple(operation: str, *inputs: tuple[str, Any]) -> Reader:
    """A node that is one operation of the core on inputs of these names and defaults."""
    return lambda call: call.operate(operation, *(call.input(*item) for item in inputs))


def _pair(operation: str, second: float = 0.0) -> Reader:
    return simple(operation, ("in1", 0.0), ("in2", second))


def _conditional(operation: str, first: float) -> Reader:
    """One of two inputs; or, as a boolean, the comparison itself."""

    def read(call: Call) -> Input:
        compares = call.type == "boolean"
        ends = (1.0, 0.0) if compares else (call.input("in1"), call.input("in2"))
        one = 1.0 if compares and not call.source.node.endswith("B") else first
        return call.operate(operation, call.input("value1", one), call.input("value2"), *ends)

    return read


def _remap(call: Call) -> Input:
    """(in - inlow) / (inhigh - inlow) into outlow … outhigh."""
    low, high = call.input("inlow"), call.input("inhigh", 1.0)
    value = call.operate("subtract", call.input("in"), low)
    value = call.operate("divide", value, call.operate("subtract", high, low))
    out_low, out_high = call.input("outlow"), call.input("outhigh", 1.0)
    value = call.operate("multiply", value, call.operate("subtract", out_high, out_low))
    return call.operate("add", value, out_low)


def _range(call: Call) -> Input:
    """As remap, with a power of 1 / gamma in between, and a clamp after it."""
    low, high = call.input("inlow"), call.input("inhigh", 1.0)
    value = call.operate("subtract", call.input("in"), low)
    value = call.operate("divide", value, call.operate("subtract", high, low))
    gamma = call.input("gamma", 1.0)
    if not (is_constant(gamma) and plain(gamma) == 1.0):
        sign, size = call.operate("sign", value), call.operate("absolute", value)
        value = call.operate("power", size, call.operate("divide", 1.0, gamma))
        value = call.operate("multiply", sign, value)
    out_low, out_high = call.input("outlow"), call.input("outhigh", 1.0)
    value = call.operate("multiply", value, call.operate("subtract", out_high, out_low))
    value = call.operate("add", value, out_low)
    if call.number("doclamp", 0):
        value = call.operate("clamp", value, out_low, out_high)
    return value


def _contrast(call: Call) -> Input:
    pivot = call.input("pivot", 0.5)
    value = call.operate("subtract", call.input("in"), pivot)
    return call.operate("add", call.operate("multiply", value, call.input("amount", 1.0)), pivot)


def _luminance(call: Call) -> Input:
    return operate("dot", call.input("in"), call.input("lumacoeffs", LUMA))


def _saturate(call: Call) -> Input:
    return call.operate("mix", call.input("in"), _luminance(call), call.input("amount", 1.0))


def _hsv_adjust(call: Call) -> Input:
    """Adds the first number of ``amount`` to the hue, multiplies saturation and value by the
    others."""
    amount = call.input("amount", (0.0, 1.0, 1.0))
    hsv = call.operate("rgb_to_hsv", call.input("in"))
    lanes = (
        operate("add", lane(hsv, 0), lane(amount, 0), width=1),
        operate("multiply", lane(hsv, 1), lane(amount, 1), width=1),
        operate("multiply", lane(hsv, 2), lane(amount, 2), width=1),
    )
    return call.operate("hsv_to_rgb", operate("combine3", *lanes))


def _blend(blend: Callable[[Call, Input, Input], Input]) -> Reader:
    """Compositing: the blend of foreground and background, mixed with the background."""

    def read(call: Call) -> Input:
        foreground, background = call.input("fg"), call.input("bg")
        blended = blend(call, foreground, background)
        return call.operate("mix", blended, background, call.input("mix", 1.0))

    return read


def _screen(call: Call, fg: Input, bg: Input) -> Input:
    left = call.operate(
        "multiply", call.operate("subtract", 1.0, fg), call.operate("subtract", 1.0, bg)
    )
    return call.operate("subtract", 1.0, left)


def _extract(call: Call) -> Input:
    return lane(call.input("in"), int(call.number("index", 0)))


def _separate(call: Call) -> Input:
    names = {"outr": 0, "outx": 0, "outg": 1, "outy": 1, "outb": 2, "outz": 2, "outa": 3, "outw": 3}
    return lane(call.input("in"), names.get(call.source.output, 0))


def _swizzle(call: Call) -> Input:
    """MaterialX 1.38: channels by letters, or 0 and 1."""
    value = call.input("in")
    letters = str(call.networks.value(call.source.shader, "channels", "")) or "x"
    picked = [
        float(letter) if letter in "01" else lane(value, "rgba".find(letter) % 4)
        for letter in letters.translate(str.maketrans("xyzw", "rgba"))
    ][: call.width]
    return picked[0] if call.width == 1 else operate(f"combine{call.width}", *picked)


def _combine(count: int) -> Reader:
    return lambda call: call.operate(
        f"combine{count}", *(call.input(f"in{i + 1}") for i in range(count))
    )


def _combine2(call: Call) -> Input:
    """Two numbers; or a colour and its alpha, as ND_combine2_color4CF."""
    first, second = call.input("in1"), call.input("in2")
    if call.width == 2:
        return call.operate("combine2", first, second)
    if "VV" in call.source.node:
        parts = (lane(first, 0), lane(first, 1), lane(second, 0), lane(second, 1))
    else:
        parts = (lane(first, 0), lane(first, 1), lane(first, 2), second)
    return call.operate("combine4", *parts)


def _convert(call: Call) -> Input:
    value, source = call.input("in"), WIDTHS[call.from_type]
    if source == 1 or source >= call.width:
        return lane(value, 0) if call.width == 1 else value
    return call.operate("convert", value, data=source)


def _switch(call: Call) -> Input:
    """in1 … in10 by the whole part of ``which``; beyond the last, the last."""
    inputs = [call.input(f"in{i}") for i in range(1, 11)]
    which = call.input("which", 0.0)
    if is_constant(which):
        return inputs[min(max(int(plain(which)), 0), 9)]
    value = inputs[-1]
    for i in range(8, -1, -1):
        value = call.operate("if_greater", float(i + 1), which, inputs[i], value)
    return value


def _place2d(call: Call) -> Input:
    """Scale, rotate and move about a pivot; order 1 moves and rotates first."""
    pivot = call.input("pivot", (0.0, 0.0))
    st = call.operate("subtract", call.texcoord(), pivot)
    steps = [
        lambda st: call.operate("divide", st, call.input("scale", (1.0, 1.0))),
        lambda st: call.operate("rotate2d", st, call.input("rotate", 0.0)),
        lambda st: call.operate("subtract", st, call.input("offset", (0.0, 0.0))),
    ]
    for step in steps if call.number("operationorder", 0) == 0 else reversed(steps):
        st = step(st)
    return call.operate("add", st, pivot)


def _ramp(axis: int, first: str, second: str) -> Reader:
    """From ``first`` at 0 to ``second`` at 1 of a texture coordinate."""

    def read(call: Call) -> Input:
        at = operate("clamp", lane(call.texcoord(), axis), 0.0, 1.0, width=1)
        return call.operate("mix", call.input(second), call.input(first), at)

    return read


def _split(axis: int, below: str, above: str) -> Reader:
    def read(call: Call) -> Input:
        at = lane(call.texcoord(), axis)
        center = call.input("center", 0.5)
        return call.operate("if_greater", center, at, call.input(below), call.input(above))

    return read


def _ramp4(call: Call) -> Input:
    st = operate("clamp", call.texcoord(), 0.0, 1.0, width=2)
    rows = [
        call.operate("mix", call.input(f"value{row}r"), call.input(f"value{row}l"), lane(st, 0))
        for row in ("b", "t")
    ]
    return call.operate("mix", rows[1], rows[0], lane(st, 1))


def _checkerboard(call: Call) -> Input:
    st = operate("multiply", call.texcoord(), call.input("uvtiling", (8.0, 8.0)), width=2)
    st = operate("subtract", st, call.input("uvoffset", (0.0, 0.0)), width=2)
    odd = operate("checker", st, width=1)
    first, second = call.input("color1", (1.0, 1.0, 1.0)), call.input("color2", (0.0, 0.0, 0.0))
    return call.operate("mix", first, second, odd)


def _noise(operation: str) -> Reader:
    """Noise of one number, scaled and shifted."""

    def read(call: Call) -> Input:
        at = call.texcoord() if operation == "noise2d" else call.position()
        value = call.operate("multiply", operate(operation, at), call.input("amplitude", 1.0))
        return call.operate("add", value, call.input("pivot", 0.0))

    return read


def _fractal3d(call: Call) -> Input:
    octaves = max(int(call.number("octaves", 3)), 0)
    value = operate(
        "fractal3d",
        call.position(),
        call.input("lacunarity", 2.0),
        call.input("diminish", 0.5),
        data=min(octaves, 32),
    )
    return call.operate("multiply", value, call.input("amplitude", 1.0))


def _in_object_space(operation: str) -> Reader:
    def read(call: Call) -> Input:
        space = str(call.networks.value(call.source.shader, "space", "object"))
        if space not in ("object", "model"):
            call.networks.report.warn(
                f"{operation}s of {space} space are read in object space",
                call.source.shader.GetPath(),
            )
        return operate(operation)

    return read


def _texcoord(call: Call) -> Input:
    index = int(call.number("index", 0))
    return PrimvarInput("st" if index == 0 else f"st{index}", (0.0, 0.0, 0.0))


def _artistic_ior(call: Call) -> Input:
    reflectivity = call.input("reflectivity", (0.944, 0.776, 0.373))
    edge = call.input("edge_color", (0.998, 0.981, 0.751))
    part = "extinction" if call.source.output == "extinction" else "index"
    return operate(f"artistic_{part}", reflectivity, edge)


def _blackbody(call: Call) -> Input:
    """USD's colour of a temperature (as lights have it), of luminance 1; 1000 to 10 000 kelvin."""
    kelvin = call.number("temperature", 5000.0)
    rgb = np.array(UsdLux.BlackbodyTemperatureAsRgb(kelvin), dtype=np.float64)
    return plain(call.networks.colors.change_primaries(rgb, DEFAULT))


OPERATIONS: dict[str, Reader] = {
    "constant": lambda call: call.input("value"),
    "dot": lambda call: call.input("in"),
    "add": _pair("add"),
    "subtract": _pair("subtract"),
    "multiply": _pair("multiply", 1.0),
    "divide": _pair("divide", 1.0),
    "modulo": _pair("modulo", 1.0),
    "power": _pair("power", 1.0),
    "min": _pair("min"),
    "max": _pair("max"),
    "atan2": simple("atan2", ("iny", 0.0), ("inx", 1.0)),
    "absval": simple("absolute", ("in", 0.0)),
    **{
        name: simple(name, ("in", 0.0))
        for name in (
            *("sign", "floor", "ceil", "round", "sqrt", "exp", "sin", "cos", "tan"),
            *("asin", "acos", "normalize", "magnitude"),
        )
    },
    "ln": simple("ln", ("in", 1.0)),
    "fract": lambda call: call.operate("modulo", call.input("in"), 1.0),
    "invert": lambda call: call.operate("subtract", call.input("amount", 1.0), call.input("in")),
    "clamp": simple("clamp", ("in", 0.0), ("low", 0.0), ("high", 1.0)),
    "mix": simple("mix", ("fg", 0.0), ("bg", 0.0), ("mix", 0.0)),
    "smoothstep": simple("smoothstep", ("in", 0.0), ("low", 0.0), ("high", 1.0)),
    "remap": _remap,
    "range": _range,
    "dotproduct": lambda call: operate(
        "dot", call.input("in1"), call.input("in2"), width=WIDTHS[call.from_type]
    ),
    "crossproduct": _pair("cross"),
    "ifgreater": _conditional("if_greater", 1.0),
    "ifgreatereq": _conditional("if_greater_or_equal", 1.0),
    "ifequal": _conditional("if_equal", 0.0),
    "switch": _switch,
    "contrast": _contrast,
    "luminance": _luminance,
    "saturate": _saturate,
    "rgbtohsv": simple("rgb_to_hsv", ("in", 0.0)),
    "hsvtorgb": simple("hsv_to_rgb", ("in", 0.0)),
    "hsvadjust": _hsv_adjust,
    "plus": _blend(lambda call, fg, bg: call.operate("add", fg, bg)),
    "minus": _blend(lambda call, fg, bg: call.operate("subtract", bg, fg)),
    "difference": _blend(
        lambda call, fg, bg: call.operate("absolute", call.operate("subtract", bg, fg))
    ),
    "screen": _blend(_screen),
    "extract": _extract,
    "swizzle": _swizzle,
    "separate2": _separate,
    "separate3": _separate,
    "separate4": _separate,
    "combine2": _combine2,
    "combine3": _combine(3),
    "combine4": _combine(4),
    "convert": _convert,
    "place2d": _place2d,
    "rotate2d": simple("rotate2d", ("in", 0.0), ("amount", 0.0)),
    "ramplr": _ramp(0, "valuel", "valuer"),
    "ramptb": _ramp(1, "valueb", "valuet"),
    "ramp4": _ramp4,
    "splitlr": _split(0, "valuel", "valuer"),
    "splittb": _split(1, "valueb", "valuet"),
    "checkerboard": _checkerboard,
    "noise2d": _noise("noise2d"),
    "noise3d": _noise("noise3d"),
    "fractal3d": _fractal3d,
    "position": _in_object_space("position"),
    "normal": _in_object_space("normal"),
    "texcoord": _texcoord,
    "geomcolor": lambda call: PrimvarInput("displayColor", (1.0, 1.0, 1.0)),
    "artistic_ior": _artistic_ior,
    "blackbody": _blackbody,
}

# Nodes whose result is a number where the type in their name is that of the input.
REDUCING = {
    "dotproduct",
    "magnitude",
    "luminance",
    "extract",
    "separate2",
    "separate3",
    "separate4",
}
ONE_NUMBER = {"noise2d", "noise3d", "fractal3d"}  # of other types, each lane has its own noise
NAME = re.compile(
    rf"ND_(?P<category>[a-zA-Z0-9_]+?)(_(?P<first>{TYPE}))?(_(?P<second>{TYPE}))?(FA|I|B|CF|VF|VV)?"
)


def reader(node: str) -> Callable[[Networks, Source, Kind], Input | None] | None:
    """What reads a MaterialX node of this identifier; None if it is none of the table's."""
    match = NAME.fullmatch(node)
    operation = match and OPERATIONS.get(match["category"])
    if not match or not operation:
        return None
    first, second = match["first"] or "color3", match["second"]
    category = match["category"]
    if category in ONE_NUMBER and first != "float":
        return None
    type = second or ("float" if category in REDUCING and category != "luminance" else first)

    def read(networks: Networks, source: Source, kind: Kind) -> Input:
        return operation(Call(networks, source, type, from_type=first))

    return read
