"""Draw modes of models: where cards, boxes and axes are, and which way up pictures are."""

from __future__ import annotations

import numpy as np
import OpenImageIO as oiio
import pytest

from support.coverage import CAMERA, covered

# A box from (-1, -1, -1) to (1, 1, 1), scaled to (1, 2, 3) half its size.
MODEL = """def Xform "x" (
    kind = "{kind}"
    prepend apiSchemas = ["GeomModelAPI"]
) {{
    {content}
    def Cube "c" {{ float3 xformOp:scale = (1, 2, 3)
        uniform token[] xformOpOrder = ["xformOp:scale"] }} }}"""
HALF = np.array([1.0, 2.0, 3.0])


def model(content: str, kind: str = "component") -> str:
    return MODEL.format(kind=kind, content=content)


def mode(name: str) -> str:
    return f'uniform token model:drawMode = "{name}"\n'


def write_image(path, pixels: np.ndarray, **attributes: object) -> None:
    spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], "float")
    for name, (kind, value) in attributes.items():
        spec.attribute(name, kind, value)
    image = oiio.ImageOutput.create(str(path))
    assert image.open(str(path), spec)
    assert image.write_image(pixels.astype(np.float32))
    image.close()


@pytest.fixture
def pictures(tmp_path):
    """An opaque 2 x 2 picture for every side."""
    for side in ("XPos", "XNeg", "YPos", "YNeg", "ZPos", "ZNeg"):
        write_image(tmp_path / f"{side}.exr", np.ones((2, 2, 4)))


def textures(*sides: str) -> str:
    return "\n".join(f"asset model:cardTexture{side} = @{side}.exr@" for side in sides) + "\n"


# ---------------------------------------------------------------------------------------------
# When they apply


@pytest.mark.parametrize(
    ("kind", "content", "drawn"),
    [
        ("component", mode("bounds"), True),
        ("component", mode("default"), False),
        ("component", "", False),
        ("group", mode("bounds"), False),
        ("group", mode("bounds") + "uniform bool model:applyDrawMode = 1", True),
    ],
)
def test_draw_modes_apply_to_components_and_where_asked(only_mesh, kind, content, drawn):
    mesh = only_mesh(model(content, kind))
    assert mesh.name == ("/x" if drawn else "/x/c")


def test_draw_modes_are_inherited(only_mesh):
    body = model(mode("inherited")).replace("\n", "\n    ")
    mesh = only_mesh(f"""def Xform "a" (
        kind = "group"
        prepend apiSchemas = ["GeomModelAPI"]
    ) {{ {mode("bounds")} {body} }}""")
    assert mesh.name == "/a/x"


def test_they_can_be_turned_off(only_mesh):
    assert only_mesh(model(mode("cards")), draw_modes=False).name == "/x/c"


def test_instances_are_drawn_too(read):
    scene = read(f"""class "P" (
            kind = "component"
            prepend apiSchemas = ["GeomModelAPI"]
        ) {{ {mode("bounds")} def Cube "c" {{}} }}
        def Xform "w" ( kind = "group" ) {{
            def Xform "a" (instanceable = true
                references = </P>
            ) {{ double3 xformOp:translate = (5, 0, 0)
                uniform token[] xformOpOrder = ["xformOp:translate"] }} }}""")
    assert [(mesh.name, mesh.transform[3, 0]) for mesh in scene.meshes] == [("/w/a", 5)]


# ---------------------------------------------------------------------------------------------
# Lines


def test_bounds_are_the_edges_of_the_box(only_mesh):
    mesh = only_mesh(model(mode("bounds") + "float3 model:drawModeColor = (1, 0, 0.5)"))
    assert np.abs(mesh.points).max(axis=0) == pytest.approx(HALF, rel=0.02)
    near = np.isclose(np.abs(mesh.points), HALF, atol=0.05).sum(axis=1)
    assert (near >= 2).all()  # on an edge two coordinates are those of the box
    assert len(mesh.triangles) == 12 * 10
    assert mesh.primvars["displayColor"].values[0].tolist() == [1, 0, 0.5]


def test_bounds_come_from_the_hint_where_there_is_one(only_mesh):
    mesh = only_mesh(model(mode("bounds") + "float3[] extentsHint = [(-4, -4, -4), (4, 4, 4)]"))
    assert np.abs(mesh.points).max(axis=0) == pytest.approx([4, 4, 4], rel=0.02)


def test_the_origin_has_three_axes_of_unit_length(only_mesh):
    mesh = only_mesh(model(mode("origin")))
    assert mesh.points.max(axis=0) == pytest.approx([1, 1, 1], abs=0.02)
    assert mesh.points.min(axis=0) == pytest.approx([0, 0, 0], abs=0.02)
    assert ((np.abs(mesh.points) < 0.02).sum(axis=1) >= 2).all()


def test_lines_are_a_pixel_wide(read):
    """An axis of 1 unit along x, one along y and a point, in pixels of 4 / 64."""
    scene = read(CAMERA + model(mode("origin")), width=64, height=64)
    assert covered(scene) == pytest.approx(2 * 1 * 4 / 64, rel=0.15)


# ---------------------------------------------------------------------------------------------
# Cards


@pytest.mark.parametrize("geometry", ["cross", "box"])
def test_without_textures_cards_have_the_color_on_all_axes(only_mesh, geometry):
    content = mode("cards") + f'uniform token model:cardGeometry = "{geometry}"'
    mesh = only_mesh(model(content))
    each = 4 if geometry == "box" else 2
    assert len(mesh.triangles) == 3 * each
    assert np.abs(mesh.points).max(axis=0) == pytest.approx(HALF)
    assert "displayColor" in mesh.primvars
    for axis in range(3):
        flat = np.ptp(mesh.points[mesh.triangles][..., axis], axis=1) == 0
        place = np.abs(mesh.points[mesh.triangles][flat][:, 0, axis])
        assert flat.sum() == each
        assert place == pytest.approx(HALF[axis] if geometry == "box" else 0, abs=1e-3)


# Seen from outside, what is to the right, and what is up.
VIEWS = {
    "XPos": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "XNeg": ((-1, 0, 0), (0, -1, 0), (0, 0, 1)),
    "YPos": ((0, 1, 0), (-1, 0, 0), (0, 0, 1)),
    "YNeg": ((0, -1, 0), (1, 0, 0), (0, 0, 1)),
    "ZPos": ((0, 0, 1), (1, 0, 0), (0, 1, 0)),
    "ZNeg": ((0, 0, -1), (1, 0, 0), (0, -1, 0)),
}


@pytest.mark.parametrize("geometry", ["cross", "box"])
@pytest.mark.parametrize("side", VIEWS)
def test_pictures_are_upright_on_the_side_they_are_of(read, pictures, geometry, side):
    content = mode("cards") + textures(*VIEWS)
    content += f'uniform token model:cardGeometry = "{geometry}"'
    scene = read(model(content))
    mesh = scene.meshes[0]
    outward, right, up = (np.array(v, float) for v in VIEWS[side])
    index = next(i for i, m in enumerate(scene.materials) if m.name.endswith(side))
    own = mesh.triangles[mesh.materials == index]
    assert len(own) == 2
    points, st = mesh.points[own].reshape(-1, 3), mesh.primvars["st"].values[own].reshape(-1, 2)
    assert st[:, 0] == pytest.approx(0.5 + points @ right / (2 * HALF @ np.abs(right)), abs=1e-6)
    assert st[:, 1] == pytest.approx(0.5 + points @ up / (2 * HALF @ np.abs(up)), abs=1e-6)
    assert (points @ outward > 0).all()
    a, b, c = (mesh.points[own[0, i]].astype(float) for i in range(3))
    assert np.cross(b - a, c - a) @ outward > 0


def test_a_side_without_picture_shows_the_other_one_from_behind(read, pictures):
    content = mode("cards") + textures("YPos") + 'uniform token model:cardGeometry = "box"'
    scene = read(model(content))
    mesh = scene.meshes[0]
    assert len(mesh.triangles) == 4  # the axes without any picture are left out
    s = mesh.primvars["st"].values[:, 0]
    assert s == pytest.approx(0.5 - mesh.points[:, 0] / 2)  # as YPos has it, on both sides


def test_cards_are_cut_out_by_alpha(read, tmp_path):
    """A picture whose left 4 of 8 columns are opaque, on a card of 2 x 2 seen from +z. Filtered, it
    falls to the threshold of 0.1 at 0.4 columns further."""
    pixels = np.ones((8, 8, 4))
    pixels[:, 4:, 3] = 0
    write_image(tmp_path / "ZPos.exr", pixels)
    body = CAMERA + model(mode("cards") + textures("ZPos")).replace("(1, 2, 3)", "(1, 1, 1)")
    assert covered(read(body, width=64, height=64)) == pytest.approx(4 * 4.4 / 8, rel=0.01)


def test_cards_from_textures_fill_the_screen_of_their_camera(read, tmp_path):
    """A matrix that takes x from 2 to 6 and y from 1 to 3 to the screen, at depth 7."""
    matrix = np.diag([0.5, 1.0, 1.0, 1.0])
    matrix[3, :3] = (-2, -2, -7)
    write_image(
        tmp_path / "XPos.exr",
        np.ones((2, 2, 4)),
        worldtoscreen=(oiio.TypeDesc("matrix"), tuple(matrix.ravel().tolist())),
    )
    content = mode("cards") + textures("XPos") + 'uniform token model:cardGeometry = "fromTexture"'
    mesh = read(model(content)).meshes[0]
    assert mesh.points.min(axis=0) == pytest.approx([2, 1, 7])
    assert mesh.points.max(axis=0) == pytest.approx([6, 3, 7])
    s = mesh.primvars["st"].values[:, 0]
    assert s == pytest.approx((mesh.points[:, 0] - 2) / 4)


def test_textures_without_a_matrix_are_warned_of(examine, pictures):
    content = mode("cards") + textures("XPos") + 'uniform token model:cardGeometry = "fromTexture"'
    found = examine(model(content))
    assert [len(w.paths) for w in found.warnings if "matrix" in w.kind] == [1]
    assert found.meshes == 0
