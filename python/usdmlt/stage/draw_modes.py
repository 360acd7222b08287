"""Models drawn as cards, bounding boxes or axes instead of their geometry (UsdGeomModelAPI).

The geometry of cards, boxes and axes is that of OpenUSD's imaging (UsdImaging draw mode stand-ins);
its lines of one pixel are tubes as wide here.
"""

from __future__ import annotations

import numpy as np
import OpenImageIO as oiio
from pxr import Sdf, Usd, UsdGeom

from usdmlt.errors import Report
from usdmlt.scene import Material, Mesh, PreviewSurface, Primvar, TextureInput
from usdmlt.stage.color import ColorSpaces
from usdmlt.stage.detail import Detail
from usdmlt.stage.materials import Materials
from usdmlt.stage.textures import Textures
from usdmlt.stage.tubes import mitred, tubes

STAND_IN = "stand-in of a model"  # a kind of its own
DRAWN = ("cards", "bounds", "origin")

# The sides of a box: their names, axis and direction, and what is to the right and up in the
# picture of one who looks at it from outside.
SIDES = {
    "XPos": (0, 1, (0, 1, 0), (0, 0, 1)),
    "XNeg": (0, -1, (0, -1, 0), (0, 0, 1)),
    "YPos": (1, 1, (-1, 0, 0), (0, 0, 1)),
    "YNeg": (1, -1, (1, 0, 0), (0, 0, 1)),
    "ZPos": (2, 1, (1, 0, 0), (0, 1, 0)),
    "ZNeg": (2, -1, (1, 0, 0), (0, -1, 0)),
}
OPPOSITE = {a + b: a + c for a in "XYZ" for b, c in (("Pos", "Neg"), ("Neg", "Pos"))}
CORNERS = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], dtype=float)  # (s, t)
CUTOUT = 0.1  # opacity from which on a card is there
GAP = 1e-4  # between the two sides of a cross, of the model's size
EDGES = [(0, 1), (1, 3), (3, 2), (2, 0), (4, 5), (5, 7), (7, 6), (6, 4), (0, 4), (1, 5), (2, 6)]
EDGES += [(3, 7)]


def draw_mode(prim: Usd.Prim) -> str:
    """How a prim is drawn, its geometry aside; "" for its geometry. Components, and other models
    that apply it, have the draw mode that they author or inherit."""
    if not prim.IsModel():
        return ""
    if not prim.IsComponent():
        attribute = prim.GetAttribute("model:applyDrawMode")
        if not (attribute and attribute.Get()):
            return ""
    mode = str(UsdGeom.ModelAPI(prim).ComputeModelDrawMode())
    return mode if mode in DRAWN else ""


class StandIns:
    """Makes the meshes that models are drawn as."""

    def __init__(
        self,
        time: Usd.TimeCode,
        purposes: tuple[str, ...],
        colors: ColorSpaces,
        materials: Materials,
        report: Report,
    ):
        self.colors = colors
        self.materials = materials
        self.textures: Textures = materials.networks.textures
        self.report = report
        self._bounds = UsdGeom.BBoxCache(time, list(purposes), useExtentsHint=True)

    def read(self, prim: Usd.Prim, detail: Detail) -> Mesh | None:
        """The mesh of a model, in its own space; None, with a note, for an empty one."""
        mode = draw_mode(prim)
        extent = None
        if mode == "origin":
            ends = [(0, 0, 0), (1, 0, 0), (0, 0, 0), (0, 1, 0), (0, 0, 0), (0, 0, 1)]
            return self._lines(prim, np.array(ends, dtype=float), detail)
        extent = self._extent(prim)
        if extent is None:
            self.report.note("models without extent are left out", prim.GetPath())
            return None
        if mode == "bounds":
            low, high = extent
            corners = np.array(
                [(x, y, z) for x in (low[0], high[0]) for y in (low[1], high[1])
                 for z in (low[2], high[2])]
            )  # fmt: skip
            return self._lines(prim, corners[np.array(EDGES).ravel()], detail)
        return self._cards(prim, *extent)

    def _extent(self, prim: Usd.Prim) -> tuple[np.ndarray, np.ndarray] | None:
        box = self._bounds.ComputeUntransformedBound(prim).ComputeAlignedRange()
        low, high = np.array(box.GetMin()), np.array(box.GetMax())
        if box.IsEmpty() or not (np.isfinite(low).all() and np.isfinite(high).all()):
            return None
        return low, high

    def _color(self, prim: Usd.Prim) -> np.ndarray:
        """(1, 3) model:drawModeColor in the rendering space."""
        attribute = UsdGeom.ModelAPI(prim).GetModelDrawModeColorAttr()
        value = attribute.Get() if attribute else None
        color = np.array([(0.18, 0.18, 0.18) if value is None else value], dtype=np.float32)
        space = self.colors.space_of(attribute) if attribute else self.colors.rendering
        return self.colors.convert(color, space).astype(np.float32)

    def _lines(self, prim: Usd.Prim, ends: np.ndarray, detail: Detail) -> Mesh:
        """Segments from every other of ``ends`` (2 n, 3) to the next, one pixel wide."""
        pixels = detail.pixels(ends, 1.0)
        size = np.ptp(ends, axis=0).max()
        width = 1 / pixels if np.isfinite(pixels) and pixels > 0 else size / 500
        curve = np.repeat(np.arange(len(ends) // 2), 2)
        points, normals, triangles = tubes(
            ends,
            mitred(ends, curve, False),
            np.full(len(ends), width / 2),
            curve,
            np.full(len(ends) // 2, 2),
            5,
            False,
        )
        return self._plain(prim, points, triangles, Primvar(normals.astype(np.float32)))

    def _plain(self, prim, points, triangles, normals=None) -> Mesh:
        color = Primvar(self._color(prim), np.zeros_like(triangles))
        return Mesh(
            points.astype(np.float32),
            triangles,
            normals,
            primvars={"displayColor": color},
            materials=self.materials.fallback(False),
            name=str(prim.GetPath()),
        )

    # -- cards

    def _cards(self, prim: Usd.Prim, low: np.ndarray, high: np.ndarray) -> Mesh | None:
        """A card per side: on the box, or across its middle, or where its texture says. A side
        without texture shows that of the opposite one from behind; an axis without any is left out,
        unless no side has one."""
        geometry = str(UsdGeom.ModelAPI(prim).GetModelCardGeometryAttr().Get() or "cross")
        textures = {name: asset for name in SIDES if (asset := _texture(prim, name)) is not None}
        if geometry == "fromTexture":
            return self._cards_from_textures(prim, textures)
        quads, st, materials = [], [], []
        for name in SIDES:
            shown = name if name in textures else OPPOSITE[name]
            if textures and shown not in textures:
                continue
            if geometry == "cross" and (shown != name if textures else name.endswith("Neg")):
                continue  # the other card is seen from behind
            quad = _side(name, low, high, geometry == "cross")
            quads.append(quad)
            st.append(_coordinates(shown, quad, low, high))
            materials.append(self._material(prim, shown, textures[shown]) if textures else 0)
        points, triangles = _two_triangles_each(quads)
        if not textures:
            return self._plain(prim, points, triangles)
        return self._textured(prim, points, triangles, np.concatenate(st), materials)

    def _cards_from_textures(
        self, prim: Usd.Prim, textures: dict[str, Sdf.AssetPath]
    ) -> Mesh | None:
        """Cards that fill the screen of each texture's camera, by the matrix in the file."""
        quads, materials = [], []
        for name, asset in textures.items():
            matrix = world_to_screen(asset.resolvedPath)
            if matrix is None:
                self.report.warn(
                    "card textures without the matrix of their camera are left out",
                    f"{prim.GetPath()} ({asset.path})",
                )
                continue
            screen = np.array([(-1, 1, 0, 1), (1, 1, 0, 1), (1, -1, 0, 1), (-1, -1, 0, 1)], float)
            corners = screen @ np.linalg.inv(matrix)
            quads.append(corners[:, :3] / corners[:, 3:])
            materials.append(self._material(prim, name, asset))
        if not quads:
            return None
        points, triangles = _two_triangles_each(quads)
        st = np.tile(CORNERS, (len(quads), 1))
        return self._textured(prim, points, triangles, st, materials)

    def _textured(self, prim, points, triangles, st, materials: list[int]) -> Mesh:
        return Mesh(
            points.astype(np.float32),
            triangles,
            primvars={"st": Primvar(st.astype(np.float32))},
            materials=np.repeat(np.array(materials, dtype=np.int32), 2),
            name=str(prim.GetPath()),
        )

    def _material(self, prim: Usd.Prim, name: str, asset: Sdf.AssetPath) -> int:
        attribute = prim.GetAttribute(f"model:cardTexture{name}")
        texture = self.textures.add(attribute, asset, None, ("clamp", "clamp"))
        fallback = (*self._color(prim)[0].tolist(), 1.0)
        return self.materials.add(
            Material(
                PreviewSurface(diffuseColor=TextureInput(texture, fallback=fallback)),
                opacity=TextureInput(texture, channel="a", fallback=fallback),
                opacity_threshold=CUTOUT,
                name=f"{prim.GetPath()}.model:cardTexture{name}",
            )
        )


def _texture(prim: Usd.Prim, name: str) -> Sdf.AssetPath | None:
    attribute = prim.GetAttribute(f"model:cardTexture{name}")
    asset = attribute.Get() if attribute else None
    return asset if asset is not None and asset.path else None


def _side(name: str, low: np.ndarray, high: np.ndarray, middle: bool) -> np.ndarray:
    """(4, 3) corners of a side, counter-clockwise seen from outside, from its lower left."""
    axis, direction, right, up = SIDES[name]
    center, half = (low + high) / 2, (high - low) / 2
    quad = np.array(
        [
            center + (2 * s - 1) * half * right + (2 * t - 1) * half * np.array(up)
            for s, t in CORNERS
        ]
    )
    reach = GAP * half.max() if middle else half[axis]
    quad[:, axis] = center[axis] + direction * reach
    return quad


def _coordinates(name: str, quad: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """(4, 2) where points are in the picture of side ``name``."""
    _, _, right, up = SIDES[name]
    size = np.where(high > low, high - low, 1)
    relative = (quad - (low + high) / 2) / size
    return 0.5 + np.stack([relative @ np.array(right), relative @ np.array(up)], axis=1)


def _two_triangles_each(quads: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    first = 4 * np.arange(len(quads))[:, None]
    triangles = (first + np.array([0, 1, 2, 0, 2, 3])).reshape(-1, 3)
    return np.concatenate(quads), triangles.astype(np.int32)


def world_to_screen(path: str) -> np.ndarray | None:
    """(4, 4) the matrix of the camera that rendered an image, from its metadata (row vectors):
    ``worldtoscreen``, or ``worldToNDC`` as older files call it."""
    image = oiio.ImageInput.open(path) if path else None
    if image is None:
        oiio.geterror()
        return None
    spec = image.spec()
    image.close()
    for name in ("worldtoscreen", "worldToNDC"):
        value = spec.getattribute(name)
        if value is not None and np.size(value) == 16:
            matrix = np.array(value, dtype=float).reshape(4, 4)
            if np.isfinite(matrix).all() and abs(np.linalg.det(matrix)) > 0:
                return matrix
    return None
