"""UsdVol volumes: fields of NumPy and OpenVDB files, where they are, and how they glow."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from support.rendering import picture
from support.usda import instance, node
from usdmlt import color
from usdmlt.errors import Error
from usdmlt.media import blackbody_emission

VDB = Path(__file__).parent / "files" / "smoke.vdb"
needs_vdb = pytest.mark.skipif(
    importlib.util.find_spec("tinyvdb") is None, reason="the extra `vdb` is not installed"
)
DENSITY = np.arange(24, dtype=np.float32).reshape(2, 3, 4)
FIELD = "asset filePath = @smoke.npz@\ntoken fieldName = "
BOX = "float3[] extent = [(-1, -2, -3), (1, 2, 3)]\n"


def stage(density: str = BOX, temperature: str | None = None, volume: str = "") -> str:
    """A volume /v of fields below it; the arguments are authored on each of the prims."""
    fields = f'def OpenVDBAsset "d" {{\n{FIELD}"density"\n{density}\n}}'
    relation = "rel field:density = </v/d>\n"
    if temperature is not None:
        fields += f'\ndef OpenVDBAsset "t" {{\n{FIELD}"temperature"\n{temperature}\n}}'
        relation += "rel field:temperature = </v/t>\n"
    return f"""def Volume "v" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
        {relation}
        {volume}
        {fields}
    }}"""


@pytest.fixture
def save(tmp_path: Path):
    """Write the arrays of smoke.npz."""

    def save_arrays(**arrays: np.ndarray) -> None:
        np.savez(tmp_path / "smoke.npz", **arrays)

    save_arrays(density=DENSITY)
    return save_arrays


def kinds(found) -> list[str]:
    return [w.kind for w in found.warnings if "no lights" not in w.kind]


# ---------------------------------------------------------------------------------------------
# NumPy


def test_a_field_fills_the_box_of_its_extent(read, save):
    scene = read(stage())
    (volume,) = scene.volumes
    assert (volume.points.min(axis=0), volume.points.max(axis=0)) == (
        pytest.approx([-1, -2, -3]),
        pytest.approx([1, 2, 3]),
    )
    grid = scene.media[volume.medium].grid
    assert np.array_equal(grid.values, DENSITY)
    assert (grid.lower, grid.upper) == ((-1, -2, -3), (1, 2, 3))
    assert scene.media[volume.medium].scattering == (1, 1, 1)  # without a material
    assert scene.meshes == []


def test_a_plain_array_needs_no_name(read, tmp_path):
    np.save(tmp_path / "smoke.npy", DENSITY)
    scene = read(stage().replace("npz", "npy"))
    assert np.array_equal(scene.media[0].grid.values, DENSITY)


def test_transforms_of_field_and_volume_apply(read, save):
    move = "double3 xformOp:translate = {}\nuniform token[] xformOpOrder = [{}]\n"
    order = '"xformOp:translate"'
    scene = read(
        stage(BOX + move.format("(1, 0, 0)", order), volume=move.format("(0, 5, 0)", order))
    )
    (volume,) = scene.volumes
    assert volume.transform[3, :3] == pytest.approx([1, 5, 0])
    assert np.array_equal(scene.media[0].grid.transform, volume.transform)


def test_the_extent_may_be_the_volumes(read, save):
    scene = read(stage(density="", volume=BOX))
    assert scene.media[0].grid.upper == (1, 2, 3)


def test_the_material_gives_coefficients_of_density_1(read, save):
    """Also where its graph multiplies by the primvar, as other renderers want it."""
    density = node("p", "ND_geompropvalue_float", 'string inputs:geomprop = "density"')
    product = node(
        "m",
        "ND_multiply_vector3FA",
        "float3 inputs:in1 = (1, 2, 3)\nfloat inputs:in2.connect = </M/p.outputs:out>",
    )
    vdf = node(
        "vdf",
        "ND_anisotropic_vdf",
        "float3 inputs:scattering.connect = </M/m.outputs:out>\n"
        "float3 inputs:absorption = (4, 5, 6)",
    )
    material = f"""def Material "M" {{
        token outputs:volume.connect = </M/v.outputs:out>
        {node("v", "ND_volume", "token inputs:vdf.connect = </M/vdf.outputs:out>")}
        {density}
        {product}
        {vdf}
    }}"""
    scene = read(material + stage(volume="rel material:binding = </M>"))
    assert scene.media[-1].scattering == (1, 2, 3)
    assert scene.media[-1].absorption == (4, 5, 6)


def test_instances_of_a_volume_have_grids_of_their_own(read, save):
    body = stage().replace("</v/", "</asset/v/")
    moved = instance("b").replace(
        "{}",
        "{ double3 xformOp:translate = (9, 0, 0)\n"
        'uniform token[] xformOpOrder = ["xformOp:translate"]\n}',
    )
    scene = read('def Xform "asset" {' + body + "}" + instance("a") + moved)
    places = sorted(scene.media[v.medium].grid.transform[3, 0] for v in scene.volumes)
    assert places == [0, 0, 9]  # the asset itself is drawn too
    assert all(
        np.array_equal(scene.media[v.medium].grid.transform, v.transform) for v in scene.volumes
    )


def test_a_uniform_field_lets_through_what_beer_says(read, save):
    """Two units of density 0.5, before white light from behind."""
    save(density=np.full((3, 2, 4), 0.5))
    camera = """def Camera "main_cam" {
            float focalLength = 500
            double3 xformOp:translate = (0, 0, 20)
            uniform token[] xformOpOrder = ["xformOp:translate"]
        }
        def DomeLight "d" {}
        def Material "M" {
            token outputs:volume.connect = </M/v.outputs:out>
            VOLUME
            VDF
        }""".replace(
        "VOLUME", node("v", "ND_volume", "token inputs:vdf.connect = </M/vdf.outputs:out>")
    ).replace("VDF", node("vdf", "ND_absorption_vdf", "float3 inputs:absorption = (0.5, 1, 2)"))
    box = "float3[] extent = [(-1, -1, -1), (1, 1, 1)]\n"
    scene = read(stage(box, volume="rel material:binding = </M>") + camera, width=8)
    got = picture(scene, samples=64)[..., :3].mean(axis=(0, 1))
    # Between the outermost cells' centres and the box's sides the density is theirs.
    assert got == pytest.approx(np.exp(-2 * 0.5 * np.array([0.5, 1, 2])), rel=2e-2)


# ---------------------------------------------------------------------------------------------
# Temperature


def test_what_is_hot_glows_as_blackbodies_do(read, save):
    temperature = np.linspace(0, 3000, 24).reshape(2, 3, 4)
    save(density=DENSITY, temperature=temperature)
    scene = read(stage(temperature=BOX, volume="float usdmlt:emission = 4"))
    emission = scene.media[0].grid.emission
    assert emission.shape == (2, 3, 4, 3)
    assert not emission[temperature < 500].any()
    hot = np.unravel_index(20, (2, 3, 4))
    at = color.blackbody_radiance(temperature[hot])
    scale = color.blackbody_radiance(2000.0) @ [0.2126, 0.7152, 0.0722]
    expected = 4 * DENSITY[hot] * np.maximum(at, 0) / scale
    assert emission[hot] == pytest.approx(expected, rel=2e-3)


def test_the_temperature_may_have_another_scale(read, save):
    save(density=DENSITY, temperature=np.full((2, 3, 4), 2.0))
    scene = read(stage(temperature=BOX, volume="float usdmlt:temperatureScale = 1000"))
    luminance = scene.media[0].grid.emission @ [0.2126, 0.7152, 0.0722]
    assert luminance == pytest.approx(DENSITY, rel=1e-3)


def test_fire_is_light_enough(examine, save):
    save(density=DENSITY, temperature=np.full((2, 3, 4), 2000.0))
    assert not any("no lights" in w.kind for w in examine(stage(temperature=BOX)).warnings)


def test_the_table_of_blackbodies_is_as_good_as_planck():
    kelvin = np.geomspace(600, 9000, 17)
    scale = color.blackbody_radiance(2000.0) @ [0.2126, 0.7152, 0.0722]
    exact = np.array([np.maximum(color.blackbody_radiance(k), 0) for k in kelvin]) / scale
    error = np.abs(blackbody_emission(kelvin, "lin_rec709_scene") - exact)
    assert (error < 2e-3 * exact.max(axis=1, keepdims=True)).all()


# ---------------------------------------------------------------------------------------------
# OpenVDB


@pytest.fixture
def vdb(tmp_path: Path) -> str:
    """A stage with two grids: 1 + x + 10 y + 100 z of indices from (0, 1, 2) to (4, 4, 4), and
    1000 more from (1, 0, 2) to (4, 4, 4); voxels of 0.5, the first at (1, 2, 3)."""
    (tmp_path / "smoke.vdb").write_bytes(VDB.read_bytes())
    return stage("", "").replace("npz", "vdb")


@needs_vdb
def test_an_openvdb_grid_is_where_its_file_says(read, vdb):
    scene = read(vdb)
    grid = scene.media[0].grid
    x, y, z = np.indices((5, 4, 3)) + np.array([0, 1, 2])[:, None, None, None]
    assert np.array_equal(grid.values, 1 + x + 10 * y + 100 * z)
    centre = np.array([*(np.array(grid.lower) + 0.5), 1.0])  # of the first voxel
    assert (centre @ grid.transform)[:3] == pytest.approx([1, 2.5, 4])
    (volume,) = scene.volumes
    corners = volume.points @ volume.transform[:3, :3] + volume.transform[3, :3]
    assert corners.min(axis=0) == pytest.approx([0.75, 2.25, 3.75])
    assert corners.max(axis=0) == pytest.approx([3.25, 4.25, 5.25])


@needs_vdb
def test_other_grids_are_taken_where_the_density_is(read, vdb):
    emission = read(vdb).media[0].grid.emission
    assert (emission[1:, :, :].max(axis=-1) > 0).all()
    assert not emission[0].any()  # x = 0, where there is no temperature


@needs_vdb
@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda text: text.replace('"density"', '"velocity"'), "not of floats"),
        (lambda text: text.replace('"density"', '"smoke"'), "no grid 'smoke', but density"),
    ],
)
def test_openvdb_grids_that_cannot_be_read_are_named(examine, vdb, change, says):
    found = examine(change(vdb))
    assert found.volumes == []
    (warning,) = (w for w in found.warnings if "OpenVDB" in w.kind)
    assert warning.paths[0].startswith("/v/d (smoke.vdb")
    assert says in warning.paths[0]


@needs_vdb
def test_a_file_that_is_cut_off_is_named(examine, vdb, tmp_path):
    (tmp_path / "smoke.vdb").write_bytes(VDB.read_bytes()[:5000])
    assert any("OpenVDB files cannot be read" in kind for kind in kinds(examine(vdb)))


def test_without_the_package_one_warning_says_what_to_install(examine, vdb, monkeypatch):
    monkeypatch.setattr("usdmlt.stage.vdb_files.is_installed", lambda: False)
    found = examine(vdb)
    (warning,) = (w for w in found.warnings if "OpenVDB" in w.kind)
    assert "pip install 'usdmlt[vdb]'" in warning.kind
    assert warning.paths == ["/v/d (smoke.vdb)"]
    assert found.volumes == []


# ---------------------------------------------------------------------------------------------
# What cannot be read


@pytest.mark.parametrize(
    ("body", "says"),
    [
        ('def Volume "v" {}', "volumes without a field of density are not rendered"),
        (stage().replace("</v/d>", "</v/x>"), "fields of volumes are missing"),
        (stage().replace("smoke.npz", "none.npz"), "files of fields are missing"),
        (stage().replace("smoke.npz", "a.f3d"), "fields are read from .npy, .npz and .vdb files"),
        (stage().replace("asset filePath = @smoke.npz@", ""), "fields without a file"),
        (stage(""), "volumes without an extent are not rendered"),
    ],
)
def test_volumes_that_cannot_be_rendered_are_left_out_and_named(examine, save, body, says):
    found = examine(body)
    assert found.volumes == []
    (warning,) = (w for w in found.warnings if "no lights" not in w.kind)
    assert says in warning.kind
    assert warning.paths[0].startswith("/v")


NEGATIVE = np.where(DENSITY == 5, -1, DENSITY)
NOT_FINITE = np.where(DENSITY == 5, np.nan, DENSITY)
COLD = np.full((2, 3, 4), 1500.0)


@pytest.mark.parametrize(
    ("arrays", "says"),
    [
        ({"density": NOT_FINITE}, r"/v/d: the grid has values that are not finite"),
        ({"density": NEGATIVE}, r"/v/d: the grid has values below 0, down to -1"),
        ({"density": DENSITY[0]}, r"/v/d: the grid is \(3, 4\), not \(nx, ny, nz\)"),
        ({"density": DENSITY[:0]}, r"/v/d: the grid is \(0, 3, 4\), not \(nx, ny, nz\)"),
        ({"density": DENSITY > 3}, r"/v/d: the grid holds bool, not numbers"),
        ({"smoke": DENSITY}, r"/v/d \(smoke.npz\): the file has no array 'density', but smoke"),
        (
            {"density": DENSITY, "temperature": COLD[:, :2]},
            r"/v/t: the temperature is \(2, 2, 4\), which does not fit the density, \(2, 3, 4\)",
        ),
        (
            {"density": DENSITY, "temperature": np.where(DENSITY == 5, np.nan, COLD)},
            r"/v/t: the grid has values that are not finite",
        ),
    ],
)
def test_broken_fields_are_an_error_of_one_line_with_their_path(read, save, arrays, says):
    save(**arrays)
    with pytest.raises(Error, match=says):
        read(stage(temperature=BOX if "temperature" in arrays else None))


def test_files_that_are_no_arrays_are_named(read, tmp_path):
    (tmp_path / "smoke.npz").write_bytes(b"junk")
    with pytest.raises(Error, match=r"/v/d \(smoke.npz\): "):
        read(stage())


def test_an_extent_without_volume_is_an_error(read, save):
    with pytest.raises(Error, match=r"/v/d: the grid's box .* has no volume"):
        read(stage("float3[] extent = [(0, 0, 0), (1, 0, 1)]"))


def test_the_command_line_says_one_line(write, save):
    save(density=NOT_FINITE)
    done = subprocess.run(
        [sys.executable, "-m", "usdmlt", "render", str(write(stage())), "a.exr"],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 1
    assert done.stderr == "usdmlt: error: /v/d: the grid has values that are not finite\n"


def test_inspection_lists_media_and_volumes(examine, save):
    found = examine(stage())
    assert (found.media, found.volumes, found.world_medium) == (["/v"], ["/v"], None)
