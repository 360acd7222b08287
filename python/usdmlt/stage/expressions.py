"""Arithmetic on material inputs: numbers and colours at once, textures and primvars as nodes."""

from __future__ import annotations

from typing import Any

import numpy as np

from usdmlt.scene import INPUT_NODES, Input, Node

# What is worked out here where all inputs are known, so that lobes that are not there can be left
# out; the core folds the rest.
KNOWN = {
    "add": np.add,
    "subtract": np.subtract,
    "multiply": np.multiply,
    "divide": np.divide,
    "power": np.power,
    "min": np.minimum,
    "max": np.maximum,
    "sqrt": np.sqrt,
    "sign": np.sign,
    "mix": lambda foreground, background, mix: background + (foreground - background) * mix,
    "clamp": lambda value, low, high: np.minimum(np.maximum(value, low), high),
}


def is_constant(value: Input) -> bool:
    """Whether an input is a number or a tuple of numbers."""
    return not isinstance(value, INPUT_NODES)


def operate(operation: str, *inputs: Any, width: int = 3, data: int = 0) -> Input:
    """An operation of the core on inputs; a number or a tuple where that is known already."""
    if operation in KNOWN and all(map(is_constant, inputs)):
        with np.errstate(all="ignore"):
            result = KNOWN[operation](*(np.asarray(i, dtype=np.float64) for i in inputs))
        if np.isfinite(result).all():
            return plain(result)
    return Node(operation, inputs, width, data)


def plain(numbers: Any) -> Any:
    """A float, or a tuple of floats."""
    numbers = np.asarray(numbers, dtype=np.float64)
    return float(numbers) if numbers.ndim == 0 else tuple(map(float, numbers))


def add(a: Input, b: Input) -> Input:
    return operate("add", a, b)


def subtract(a: Input, b: Input) -> Input:
    return operate("subtract", a, b)


def multiply(a: Input, b: Input) -> Input:
    """A product; a factor that is the number 1 leaves the other as it is."""
    for factor, other in ((a, b), (b, a)):
        if is_constant(factor) and np.ndim(factor) == 0 and factor == 1.0:
            return other
    return operate("multiply", a, b)


def divide(a: Input, b: Input) -> Input:
    return operate("divide", a, b)


def power(a: Input, b: Input) -> Input:
    if is_constant(b) and np.ndim(b) == 0 and b == 1.0:
        return a
    return operate("power", a, b)


def mix(foreground: Input, background: Input, share: Input) -> Input:
    """``background (1 - share) + foreground share``; an end alone where that is the result."""
    if is_constant(share) and np.ndim(share) == 0 and share in (0.0, 1.0):
        return foreground if share == 1.0 else background
    return operate("mix", foreground, background, share)


def clamp(value: Input, low: Input = 0.0, high: Input = 1.0) -> Input:
    return operate("clamp", value, low, high)


def lane(value: Input, index: int) -> Input:
    """One number of a vector or colour; a number is itself."""
    if is_constant(value):
        numbers = np.asarray(value, dtype=np.float64)
        return float(numbers) if numbers.ndim == 0 else float(numbers[min(index, len(numbers) - 1)])
    return operate("extract", value, width=1, data=index)
