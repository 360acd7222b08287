"""Image files into textures of the rendering colour space.

Files are read with OpenImageIO; those inside a usdz package, and those of any other asset
resolver, through USD's resolver.
"""

from __future__ import annotations

import os
import tempfile
from dataclasses import dataclass

import numpy as np
import OpenImageIO as oiio
from pxr import Ar, Sdf, Usd, UsdShade

from usdmlt.errors import Report
from usdmlt.scene import Texture
from usdmlt.stage.color import DEFAULT, ColorSpaces, decode

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
        self._pixels: dict[tuple, np.ndarray] = {}
        self._indices: dict[tuple, int] = {}

    def add(
        self,
        attribute: Usd.Attribute,
        asset: Sdf.AssetPath,
        space: str | None,
        wrap: tuple[str | None, str | None],
        is_color: bool = True,
    ) -> int | None:
        """The index of a material texture; None, with a warning, if the file cannot be read.

        ``space``: the colour space of the pixels, "raw" for data, None to follow the "auto" rule.
        ``wrap``: names of the s and t wrap modes; None takes the file's, or black.
        ``is_color``: the primaries are converted too, not only the transfer curve undone.
        """
        path = self._resolve(attribute, asset)
        image = self._open(path, asset, attribute)
        if image is None:
            return None
        modes = image.wrap_modes.split(",")
        modes = [WRAPS.get(mode.strip(), "black") for mode in (*modes, modes[-1])[:2]]
        wrap_s, wrap_t = (WRAPS.get(w, m) for w, m in zip(wrap, modes, strict=True))
        return self._index(
            path, image, space or image.transfer, wrap_s, wrap_t, is_color, np.float16
        )

    def add_light_texture(self, attribute: Usd.Attribute, asset: Sdf.AssetPath) -> int | None:
        """The index of a light's texture, float32. Its attribute may name a colour space."""
        path = self._resolve(attribute, asset)
        image = self._open(path, asset, attribute)
        if image is None:
            return None
        space = image.transfer
        if attribute.HasColorSpace():
            space = self.colors.named(attribute.GetColorSpace(), attribute.GetPath())
        return self._index(path, image, space, "repeat", "clamp", True, np.float32)

    def _index(
        self,
        path: str,
        image: ImageFile,
        space: str,
        wrap_s: str,
        wrap_t: str,
        is_color: bool,
        dtype: type,
    ) -> int:
        pixels_key = (path, space, is_color, dtype)
        key = (*pixels_key, wrap_s, wrap_t)
        if key not in self._indices:
            if pixels_key not in self._pixels:
                self._pixels[pixels_key] = to_rendering(
                    image.pixels, space, is_color, self.colors, dtype
                )
            self._indices[key] = len(self.textures)
            self.textures.append(
                Texture(self._pixels[pixels_key], wrap_s=wrap_s, wrap_t=wrap_t, name=path)
            )
        return self._indices[key]

    def _resolve(self, attribute: Usd.Attribute, asset: Sdf.AssetPath) -> str:
        """Where the file is; of a UDIM set, its first tile. "" if there is none."""
        if not UsdShade.UdimUtils.IsUdimIdentifier(asset.path):
            return asset.resolvedPath
        self.report.warn("UDIM textures are read as their first tile", attribute.GetPath())
        for spec in attribute.GetPropertyStack(self.time):
            if spec.layer is None:
                continue
            tiles = UsdShade.UdimUtils.ResolveUdimTilePaths(asset.path, spec.layer)
            if tiles:
                return min(tiles, key=lambda tile: tile[1])[0]
        return ""

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


def to_rendering(
    pixels: np.ndarray, space: str, is_color: bool, colors: ColorSpaces, dtype: type
) -> np.ndarray:
    """Stored pixels as float16 or float32, linear and, for colours, in the rendering space.

    Alpha (the second of two channels, the fourth of four) is never decoded.
    """
    color_channels = {1: 1, 2: 1, 3: 3, 4: 3}[pixels.shape[2]]
    in_rendering = space == "raw" or not is_color or color_channels < 3
    in_rendering = in_rendering or colors.same_primaries(space)
    if pixels.dtype.kind == "u":
        top = np.iinfo(pixels.dtype).max
        linear = np.arange(top + 1, dtype=np.float64) / top
        curve = linear if space == "raw" else decode(linear, space)
        curve_type = dtype if in_rendering else np.float32
        result = np.empty(pixels.shape, dtype=curve_type)
        result[..., :color_channels] = curve.astype(curve_type)[pixels[..., :color_channels]]
        result[..., color_channels:] = linear.astype(curve_type)[pixels[..., color_channels:]]
    else:
        result = pixels.astype(np.float32)
        if space != "raw":
            result[..., :color_channels] = decode(result[..., :color_channels], space)
    if not in_rendering:
        result[..., :3] = colors.change_primaries(result[..., :3], space)
    if result.dtype != np.float16:
        np.nan_to_num(result, copy=False, nan=0.0, posinf=HALF_MAX, neginf=-HALF_MAX)
        if dtype is np.float16:
            np.clip(result, -HALF_MAX, HALF_MAX, out=result)
    return np.ascontiguousarray(result, dtype=dtype)


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
    return ImageFile(
        _full_window(pixels.reshape(spec.height, spec.width, -1), spec),
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
