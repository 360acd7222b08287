"""`usdmlt compare`: what decides, and the exit status."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import usdmlt
from usdmlt.errors import Error
from usdmlt.image import Image
from usdmlt.image_files import Part, write_parts
from usdmlt.stage import load
from usdmlt.testing import comparison, references
from usdmlt.testing.batches import Batches, render_batches

SCENE = Path(__file__).parents[2] / "scenes" / "cornell_box.usda"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """References a, b (other random numbers) and moved (the camera); pictures with error layers."""
    folder = tmp_path_factory.mktemp("pictures")
    scene = load(SCENE, width=64)
    options = {"integrator": "path", "samples": 48}
    references.write(folder / "a.exr", render_batches(scene, **options))
    references.write(folder / "b.exr", render_batches(scene, stream=1, **options))
    for seed in (1, 2):
        usdmlt.render(scene, seed=seed, **options).write(folder / f"path{seed}.exr")
        usdmlt.render(scene, seed=seed, integrator="mlt", samples=64).write(
            folder / f"mlt{seed}.exr"
        )
    scene.camera.transform[3, 0] += 20
    references.write(folder / "moved.exr", render_batches(scene, stream=2, **options))
    usdmlt.render(scene, seed=3, **options).write(folder / "moved_path.exr")
    return folder


@pytest.fixture
def compare(folder: Path) -> Callable[..., tuple[int, str]]:
    """Run `usdmlt compare` there: exit status and output."""

    def run(*arguments: str) -> tuple[int, str]:
        command = [sys.executable, "-m", "usdmlt", "compare", *arguments]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120)
        assert "Traceback" not in done.stderr
        return done.returncode, done.stdout + done.stderr

    return run


def test_a_file_is_the_same_as_itself(compare: Callable[..., tuple[int, str]]) -> None:
    status, output = compare("a.exr", "a.exr")
    assert status == 0 and "bit for bit" in output


def test_other_random_numbers_are_no_difference(compare: Callable[..., tuple[int, str]]) -> None:
    status, output = compare("a.exr", "b.exr")
    assert status == 0
    assert float(re.search(r"p = ([\d.e-]+)", output)[1]) > 1e-4
    assert "smallest change that would have been seen" in output


@pytest.mark.parametrize("pair", [("a.exr", "moved.exr"), ("path1.exr", "moved_path.exr")])
def test_a_moved_camera_is_a_difference(
    compare: Callable[..., tuple[int, str]], pair: tuple[str, str]
) -> None:
    status, output = compare(*pair)
    assert status == 1 and output.startswith("different\n")


@pytest.mark.parametrize(
    "pair", [("path1.exr", "path2.exr"), ("path1.exr", "mlt1.exr"), ("mlt1.exr", "mlt2.exr")]
)
def test_error_layers_allow_for_noise(
    compare: Callable[..., tuple[int, str]], pair: tuple[str, str]
) -> None:
    status, output = compare(*pair)
    assert status == 0 and "approximate" in output


def test_without_errors_values_have_to_agree(
    compare: Callable[..., tuple[int, str]], folder: Path
) -> None:
    rgba = np.full((8, 9, 4), 0.5, np.float32)
    Image.from_rgba(rgba).write(folder / "plain.exr")
    rgba[0, 0, 0] += 0.01
    Image.from_rgba(rgba).write(folder / "other.exr")
    assert compare("plain.exr", "plain.exr")[0] == 0
    status, output = compare("plain.exr", "other.exr")
    assert status == 1 and "1 of 72 pixels differ by more than 1e-06" in output
    assert compare("plain.exr", "other.exr", "--fail", "0.02")[0] == 0
    assert compare("plain.exr", "other.exr", "--failpercent", "2")[0] == 0
    assert compare("plain.exr", "other.exr", "--failpercent", "2", "--hardfail", "0.005")[0] == 1


def test_what_cannot_be_compared_is_status_2(
    compare: Callable[..., tuple[int, str]], folder: Path
) -> None:
    (folder / "broken.exr").write_bytes((folder / "a.exr").read_bytes()[:2000])
    Image.from_rgba(np.ones((4, 4, 4), np.float32)).write(folder / "small.exr")
    for other in ("missing.exr", "broken.exr", "small.exr"):
        status, output = compare("a.exr", other)
        assert status == 2 and output.startswith("usdmlt: error: ") and output.count("\n") == 1
    assert "differ in size: 64x64 and 4x4" in output
    assert compare("a.exr", "b.exr", "--significance", "2")[0] == 2
    for option in ("--flip", "nan"), ("--report", "missing/page.html"), ("--report", "."):
        status, output = compare("a.exr", "b.exr", *option)
        assert status == 2 and output.startswith("usdmlt: error: ") and output.count("\n") == 1
    status, output = compare("a.exr", "b.exr", "--significance", "1e-5")
    assert status == 2 and "significance must be at least 1.5e-05" in output
    assert compare("a.exr", "b.exr", "--fail", "-1")[0] == 2


def test_other_layers_have_to_be_the_same(tmp_path: Path) -> None:
    def write(name: str, **layers: np.ndarray) -> Path:
        rgb = {c: np.full((4, 5), 0.5, np.float32) for c in "RGB"}
        write_parts(tmp_path / name, [Part(rgb | layers, {})])
        return tmp_path / name

    depth = np.arange(20, dtype=np.float32).reshape(4, 5)
    depth[0, 0] = np.nan
    one, same = write("one.exr", Z=depth), write("same.exr", Z=depth)
    further = depth.copy()
    further[3, 4] = np.nextafter(further[3, 4], np.inf)
    assert not comparison.compare_files(one, same).different
    other = write("other.exr", Z=further)
    assert comparison.compare_files(one, other).reasons == ["the layer Z differs in 1 of 20 pixels"]
    reasons = comparison.compare_files(one, write("none.exr")).reasons
    assert reasons == ["only the reference has the layer Z"]


def test_ids_are_compared_as_whole_numbers(tmp_path: Path) -> None:
    """Floats cannot tell these two apart, and have a part of their own in the file."""

    def write(name: str, number: int) -> Path:
        picture = Image.from_rgba(np.full((4, 5, 4), 0.5, np.float32))
        picture.channels["objectId"] = np.full((4, 5), number, np.uint32)
        picture.write(tmp_path / name)
        return tmp_path / name

    one = write("one.exr", 2**31)
    assert not comparison.compare_files(one, write("same.exr", 2**31)).different
    (reason,) = comparison.compare_files(one, write("other.exr", 2**31 + 1)).reasons
    assert reason == "the layer objectId differs in 20 of 20 pixels"


def test_a_reference_keeps_layers_and_pictures_in_memory_are_compared_with_them(
    tmp_path: Path,
) -> None:
    """Normals are halves in files: what they round away is no difference; 2^-9 is one."""
    rng = np.random.default_rng(2)
    layers = {
        "N": rng.normal(size=(6, 8, 3)).astype(np.float32),
        "Z": rng.random((6, 8)).astype(np.float32),
        "objectId": rng.integers(0, 2**32, (6, 8), np.uint32),
    }
    pictures = rng.random((24, 6, 8, 4)).astype(np.float32)
    mean = pictures.mean(axis=0)
    picture = {"color": mean[..., :3], "alpha": mean[..., 3]}
    batches = Batches(picture | layers, pictures=pictures, bits="abc", made={"settings": {}})
    references.write(tmp_path / "a.exr", batches)
    reference = references.read(tmp_path / "a.exr")
    assert not comparison.compare(reference, batches).different
    for name in layers:
        changed = layers[name].copy()
        changed[2, 3] += np.uint32(1) if name == "objectId" else 2**-9
        batches.channels = picture | layers | {name: changed}
        reasons = comparison.compare(reference, batches).reasons
        assert reasons == [f"the layer {name} differs in 1 of 48 pixels"]


def test_layers_of_light_paths_may_be_noisy_where_the_picture_is(tmp_path: Path) -> None:
    def write(name: str, color: float, layer: float) -> Path:
        pixels = {c: np.full((4, 5), color, np.float32) for c in "RGB"}
        pixels |= {f"key.{c}": np.full((4, 5), layer, np.float32) for c in "RGB"}
        pixels["error.Y"] = np.full((4, 5), 0.1, np.float32)
        attributes = {"usdmlt:light_paths": '{"key": "C.*<L.\'key\'>"}'}
        write_parts(tmp_path / name, [Part(pixels, attributes)])
        return tmp_path / name

    one = write("one.exr", 0.5, 0.25)
    noisy = comparison.compare_files(one, write("noisy.exr", 0.5001, 0.3))
    assert not noisy.different
    assert noisy.notes[-1] == "not compared, as their noise is not known: key"
    changed = comparison.compare_files(one, write("changed.exr", 0.5, 0.3))
    assert changed.reasons[0] == "the layer key differs in 20 of 20 pixels"


def test_a_picture_without_colours_is_compared_too(tmp_path: Path) -> None:
    for name, value in (("a.exr", 0.5), ("b.exr", 0.75)):
        part = Part({"Y": np.full((4, 5), value, np.float32)}, {})
        write_parts(tmp_path / name, [part])
    assert not comparison.compare_files(tmp_path / "a.exr", tmp_path / "a.exr").different
    result = comparison.compare_files(tmp_path / "a.exr", tmp_path / "b.exr")
    assert result.different and result.metrics.difference.largest == 0.25


def test_pixels_that_are_not_finite_are_a_difference() -> None:
    a = Image.from_rgba(np.ones((4, 4, 4), np.float32))
    rgba = np.ones((4, 4, 4), np.float32)
    rgba[1, 2, 0] = np.nan
    result = comparison.compare(a, Image.from_rgba(rgba))
    assert "1 pixels are not finite" in result.reasons


def with_errors(rgba: np.ndarray, error: np.ndarray | float = 0.01) -> Image:
    picture = Image.from_rgba(rgba.astype(np.float32))
    picture.channels["error"] = np.broadcast_to(error, rgba.shape[:2]).astype(np.float32)
    return picture


def noisy(seed: int, level: float = 0.01) -> np.ndarray:
    """Of 32 x 32 pixels, with the error that with_errors says: noise of all colours alike."""
    rgba = np.ones((32, 32, 4))
    rgba[..., :3] = 0.5 + level * np.random.default_rng(seed).normal(size=(32, 32, 1))
    return rgba


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_errors_that_are_not_finite_hide_nothing(value: float) -> None:
    error = np.full((32, 32), 0.01)
    error[3, 4] = value
    changed = noisy(2)
    changed[8:16, 8:16, :3] += 0.05
    result = comparison.compare(with_errors(noisy(1)), with_errors(changed, error))
    assert result.reasons[0] == "1 pixels have errors that are not finite"
    assert any("luminance" in reason for reason in result.reasons)


def test_by_error_layers_hue_and_alpha_are_looked_at() -> None:
    reference = with_errors(noisy(1))
    assert not comparison.compare(reference, with_errors(noisy(2))).different
    hue = noisy(2)
    hue[8:24, 8:24, :3] += np.array([0.1, 0, -0.1 * 0.2126 / 0.0722])  # of the same luminance
    (reason, *_) = comparison.compare(reference, with_errors(hue)).reasons
    assert reason.startswith(("red +", "blue -"))
    hole = noisy(2)
    hole[8:16, 8:16, 3] = 0
    (reason, *_) = comparison.compare(reference, with_errors(hole)).reasons
    assert reason.startswith("alpha -")
    # A pixel at an edge, met by one sample in a hundred.
    edge = noisy(2)
    edge[:, 5, 3] -= 0.01
    assert not comparison.compare(reference, with_errors(edge)).different


def test_pictures_in_other_places_of_the_whole_are_different(tmp_path: Path) -> None:
    rgb = {c: np.full((4, 5), 0.5, np.float32) for c in "RGB"}
    for name, x in (("a.exr", 1), ("b.exr", 2)):
        window = {"x": x, "y": 1, "full_width": 9, "full_height": 9}
        write_parts(tmp_path / name, [Part(rgb, {}, window)])
    assert not comparison.compare_files(tmp_path / "a.exr", tmp_path / "a.exr").different
    result = comparison.compare_files(tmp_path / "a.exr", tmp_path / "b.exr")
    assert result.reasons == ["the data windows differ: they start at (1, 1) and (2, 1)"]


def test_all_parts_are_compared(tmp_path: Path) -> None:
    """Those with channels of the same names, those of other sizes, and colours after others."""

    def write(name: str, *values: float) -> Path:
        def part(name: str, channels: str, value: float, columns: int = 5) -> Part:
            pixels = np.full((4, columns), value, np.float32)
            window = {"x": 0, "y": 0, "full_width": 5, "full_height": 4}
            return Part(dict.fromkeys(channels, pixels), {"oiio:subimagename": name}, window)

        depth, beauty, diffuse, small = values
        parts = [
            part("depth", "Z", depth),
            part("beauty", "RGBA", beauty),
            part("diffuse", "RGB", diffuse),
            part("small", "RGB", small, columns=3),
        ]
        write_parts(tmp_path / name, parts)
        return tmp_path / name

    one = write("one.exr", 1, 0.5, 0.25, 0.75)
    assert not comparison.compare_files(one, one).different
    for values, wanted in {
        (2, 0.5, 0.25, 0.75): ["the layer Z differs in 20 of 20 pixels"],
        (1, 0.6, 0.25, 0.75): ["20 of 20 pixels differ by more than 1e-06, the most by 0.1"],
        (1, 0.5, 0.35, 0.75): ["the layer diffuse differs in 20 of 20 pixels"],
        (1, 0.5, 0.25, 0.85): [f"the layer small.{c} differs in 12 of 12 pixels" for c in "BGR"],
    }.items():
        assert comparison.compare_files(one, write("other.exr", *values)).reasons == wanted


def test_flip_decides_where_it_is_asked_for(folder: Path) -> None:
    pytest.importorskip("flip_evaluator")
    result = comparison.compare_files(folder / "a.exr", folder / "b.exr", flip=1.0)
    assert not result.different
    result = comparison.compare_files(folder / "a.exr", folder / "b.exr", flip=0.001)
    assert result.reasons[0].startswith("FLIP is ")


def test_a_reference_comes_back_as_it_was_written(tmp_path: Path) -> None:
    """Halves are exact to 2^-11, of cells whose means were taken in double."""
    rng = np.random.default_rng(1)
    pictures = (1e-6 * rng.random((24, 7, 10, 4))).astype(np.float32)
    mean = pictures.mean(axis=0)
    batches = Batches(
        {"color": mean[..., :3], "alpha": mean[..., 3]},
        metadata={"pixel_aspect_ratio": 2.0, "frames_per_second": 24.0},  # of all parts of a file
        pictures=pictures,
        bits="abc",
        made={"settings": {"samples": 3}, "stage_hash": "12"},
    )
    references.write(tmp_path / "a.exr", batches, cell=2)
    back = references.read(tmp_path / "a.exr")
    assert back.metadata["pixel_aspect_ratio"] == 2 and back.metadata["frames_per_second"] == 24
    assert back.cell == 2 and back.bits == "abc" and back.made == batches.made
    assert back.pictures.shape == (24, 4, 5, 4)
    expected = pictures[:, 2:4, 4:6].mean(axis=(1, 2), dtype=np.float64)
    assert np.allclose(back.pictures[:, 1, 2], expected, rtol=2**-11, atol=0)
    assert np.allclose(back.pictures[:, 3, 4], pictures[:, 6, 8:].mean(axis=1), rtol=2**-10)
    again = references.rounded(back.pictures, back.scale)
    assert np.array_equal(again, back.pictures)


def test_a_batch_that_is_not_a_number_is_a_difference_and_the_rest_is_tested() -> None:
    pictures = np.random.default_rng(1).random((2, 24, 8, 8, 4)).astype(np.float32)
    pictures[1, 5, 3, 4, 0] = np.nan
    a, b = (
        Batches({"color": x.mean(axis=0)[..., :3], "alpha": x.mean(axis=0)[..., 3]}, pictures=x)
        for x in pictures
    )
    result = comparison.compare(a, b)
    assert result.reasons == ["1 pixels are not finite"]
    assert result.outcome is not None and 1e-3 < result.outcome.p <= 1


@pytest.mark.parametrize(
    ("changed", "same"),
    [({"seed": 1}, True), ({"two_stage": False}, False), ({"samples": 48}, False)],
)
def test_settings_that_make_other_noise_are_known(changed: dict[str, object], same: bool) -> None:
    settings = {"integrator": "mlt", "samples": 24, "seed": 0, "two_stage": True}
    pictures = [Batches({}, made={"settings": settings | more}) for more in ({}, changed)]
    assert comparison.same_noise(*pictures) == same


def test_a_picture_without_batches_is_no_reference(tmp_path: Path) -> None:
    Image.from_rgba(np.ones((4, 4, 4), np.float32)).write(tmp_path / "a.exr")
    with pytest.raises(Error, match="has no batches"):
        references.read(tmp_path / "a.exr")
