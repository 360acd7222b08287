"""Image files into textures that become linear in the rendering colour space.

Pixels keep the depth they are stored in, and each file is kept once, however many materials,
colour spaces and wrap modes it is read with.

Files are read with OpenImageIO; those inside a usdz package, and those of any other asset
resolver, through USD's resolver.
"""

from __future__ import annotations

import os
import tempfile
from dataclasses import dataclass
from functools import cache

import numpy as np
import OpenImageIO as oiio
from pxr import Ar, Sdf, Usd, UsdShade

from usdmlt.errors import Report
from usdmlt.scene import Texture
from usdmlt.stage.color import DEFAULT, ColorSpaces, conversion_matrix, decode, transfer

WRAPS = {
    "black": "black",
    "clamp": "clamp",
    "repeat": "repeat",
    "periodic": "repeat",
    "mirror": "mirror",
}
HALF_MAX = float(np.finfo(np.float16).max)


class Unreadable(Exception):
    """An image that cannot be opened or decoded; the message says why."""


@dataclass
class ImageFile:
    """Pixels as stored: (height, width, channels), uint8, uint16, float16 or float32."""

    pixels: np.ndarray
    color_space: str  # what OpenImageIO says; "" if nothing
    wrap_modes: str  # "s,t" of the file's metadata; "" if it has none

    @property
    def transfer(self) -> str:
        """The space that UsdUVTexture's sourceColorSpace "auto" means for this file.

        8-bit images of three and more channels are sRGB unless they say that they are linear;
        all others are as stored (UsdPreviewSurface specification, Texture Reader).
        """
        if self.pixels.dtype != np.uint8 or self.pixels.shape[2] < 3:
            return DEFAULT
        return DEFAULT if self.color_space.lower().startswith("lin") else "srgb_rec709_scene"


class Textures:
    """The textures of a scene, each file read once."""

    def __init__(self, time: Usd.TimeCode, colors: ColorSpaces, report: Report):
        self.time = time
        self.colors = colors
        self.report = report
        self.textures: list[Texture] = []
        self._files: dict[str, ImageFile | None] = {}
        self._linear: dict[tuple[str, str], np.ndarray] = {}  # of floats with a transfer curve
        self._indices: dict[tuple, int] = {}

    def add(
        self,
        attribute: Usd.Attribute,
        asset: Sdf.AssetPath,
        space: str | None,
        wrap: tuple[str | None, str | None],
        is_color: bool = True,
    ) -> int | dict[int, int] | None:
        """The index of a material texture; of a UDIM set, the index of each tile, by its number.
        None, with a warning, if no file can be read.

        ``space``: the colour space of the pixels, "raw" for data, None to follow the "auto" rule.
        ``wrap``: names of the s and t wrap modes; None takes the file's, or black.
        ``is_color``: the primaries are converted too, not only the transfer curve undone.
        """
        if not UsdShade.UdimUtils.IsUdimIdentifier(asset.path):
            return self._add_file(asset.resolvedPath, attribute, asset, space, wrap, is_color)
        tiles: dict[int, int] = {}
        for path, number in self._tiles(attribute, asset):
            index = self._add_file(path, attribute, asset, space, ("clamp", "clamp"), is_color)
            if index is not None:
                tiles[int(number)] = index
        if not tiles:
            self._open("", asset, attribute)
        return tiles or None

    def add_light_texture(self, attribute: Usd.Attribute, asset: Sdf.AssetPath) -> int | None:
        """The index of a light's texture. Its attribute may name a colour space."""
        space = None
        if attribute.HasColorSpace():
            space = self.colors.declared(attribute.GetColorSpace(), attribute)
        path = asset.resolvedPath
        if UsdShade.UdimUtils.IsUdimIdentifier(asset.path):
            self.report.warn(
                "UDIM textures of lights are read as their first tile", attribute.GetPath()
            )
            path = next((path for path, _ in self._tiles(attribute, asset)), "")
        return self._add_file(path, attribute, asset, space, ("repeat", "clamp"), True)

    def _add_file(
        self,
        path: str,
        attribute: Usd.Attribute,
        asset: Sdf.AssetPath,
        space: str | None,
        wrap: tuple[str | None, str | None],
        is_color: bool,
    ) -> int | None:
        image = self._open(path, asset, attribute)
        if image is None:
            return None
        space = space or image.transfer
        modes = image.wrap_modes.split(",")
        modes = [WRAPS.get(mode.strip(), "black") for mode in (*modes, modes[-1])[:2]]
        wrap_s, wrap_t = (WRAPS.get(w, m) for w, m in zip(wrap, modes, strict=True))
        matrix = self._matrix(image, space) if is_color else None
        key = (path, space, matrix is None, wrap_s, wrap_t)
        if key not in self._indices:
            self._indices[key] = len(self.textures)
            self.textures.append(
                Texture(
                    self._pixels(path, image, space),
                    wrap_s=wrap_s,
                    wrap_t=wrap_t,
                    name=path,
                    decode=curve(space, image.pixels.dtype),
                    matrix=matrix,
                )
            )
        return self._indices[key]

    def _pixels(self, path: str, image: ImageFile, space: str) -> np.ndarray:
        """As stored; floats that have a transfer curve are decoded, in their own depth."""
        if image.pixels.dtype.kind == "u" or not has_curve(space):
            return image.pixels
        if (path, space) not in self._linear:
            colors = 1 if image.pixels.shape[2] < 3 else 3
            linear = image.pixels.copy()
            linear[..., :colors] = decode(linear[..., :colors].astype(np.float32), space)
            self._linear[path, space] = linear
        return self._linear[path, space]

    def _matrix(self, image: ImageFile, space: str) -> np.ndarray | None:
        if space == "raw" or image.pixels.shape[2] < 3 or self.colors.same_primaries(space):
            return None
        return conversion_matrix(space, self.colors.rendering)

    def _tiles(self, attribute: Usd.Attribute, asset: Sdf.AssetPath) -> list[tuple[str, str]]:
        """The files and numbers of a UDIM set, sought from the layers that author its path."""
        for spec in attribute.GetPropertyStack(self.time):
            if spec.layer is None:
                continue
            tiles = UsdShade.UdimUtils.ResolveUdimTilePaths(asset.path, spec.layer)
            if tiles:
                return sorted(tiles, key=lambda tile: tile[1])
        return []

    def _open(self, path: str, asset: Sdf.AssetPath, attribute: Usd.Attribute) -> ImageFile | None:
        if not path:
            self.report.warn("texture files are missing", f"{attribute.GetPath()} ({asset.path})")
            return None
        if path not in self._files:
            try:
                self._files[path] = read_image(path)
            except Unreadable as reason:
                self._files[path] = None
                self.report.warn(
                    "texture files cannot be read", f"{attribute.GetPath()} ({path}: {reason})"
                )
        return self._files[path]


def has_curve(space: str) -> bool:
    """Whether stored values of a colour space are not linear."""
    return space != "raw" and (space.startswith("srgb") or transfer(space)[0] != 1)


@cache
def curve(space: str, dtype: np.dtype) -> np.ndarray | None:
    """The linear value of every stored integer, float32; None where it is just a fraction."""
    if dtype.kind != "u" or not has_curve(space):
        return None
    top = np.iinfo(dtype).max
    return decode(np.arange(top + 1, dtype=np.float64) / top, space).astype(np.float32)


def read_image(path: str) -> ImageFile:
    """Read the first image of a file, straight alpha. Raises :class:`Unreadable`."""
    if os.path.isfile(path):
        return _read_file(path)
    # OpenImageIO's Python bindings read files only, so what the resolver hands over in memory
    # goes through a temporary one.
    asset = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(path))
    if not asset:
        raise Unreadable("the resolver cannot open it")
    extension = Ar.GetResolver().GetExtension(path)
    with tempfile.TemporaryDirectory(prefix="usdmlt-") as folder:
        name = os.path.join(folder, f"texture.{extension}")
        with open(name, "wb") as file:
            file.write(asset.GetBuffer())
        return _read_file(name)


def _read_file(path: str) -> ImageFile:
    config = oiio.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)  # alpha is straight in UsdUVTexture
    source = oiio.ImageInput.open(path, config)
    if source is None:
        raise Unreadable(_first_line(oiio.geterror()))
    spec = source.spec()
    stored = {"uint8": "uint8", "uint16": "uint16", "half": "half"}.get(str(spec.format), "float")
    pixels = source.read_image(0, 0, 0, min(spec.nchannels, 4), stored)
    failure = source.geterror()
    source.close()
    if pixels is None:
        raise Unreadable(_first_line(failure))
    pixels = np.asarray(pixels)
    if pixels.dtype == np.uint16 and stored == "half":
        pixels = pixels.view(np.float16)
    if pixels.dtype.kind == "f" and not np.isfinite(pixels).all():
        pixels = np.nan_to_num(pixels, nan=0.0, posinf=HALF_MAX, neginf=-HALF_MAX)
    return ImageFile(
        np.ascontiguousarray(_full_window(pixels.reshape(spec.height, spec.width, -1), spec)),
        spec.get_string_attribute("oiio:ColorSpace"),
        spec.get_string_attribute("wrapmodes"),
    )


def _full_window(pixels: np.ndarray, spec: oiio.ImageSpec) -> np.ndarray:
    """The whole display window of a file that stores only a part of it (or more than it)."""
    x, y = spec.x - spec.full_x, spec.y - spec.full_y
    height, width = spec.full_height, spec.full_width
    if (x, y, width, height) == (0, 0, spec.width, spec.height):
        return pixels
    whole = np.zeros((height, width, pixels.shape[2]), dtype=pixels.dtype)
    rows = slice(max(y, 0), min(y + spec.height, height))
    columns = slice(max(x, 0), min(x + spec.width, width))
    if rows.start < rows.stop and columns.start < columns.stop:
        whole[rows, columns] = pixels[
            rows.start - y : rows.stop - y, columns.start - x : columns.stop - x
        ]
    return whole


def _first_line(message: str) -> str:
    return message.strip().splitlines()[0] if message.strip() else "no reason given"
