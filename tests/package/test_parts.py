"""Part files: pictures whose integers come back bit by bit, and that are refused if damaged."""

from __future__ import annotations

import random
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

import usdmlt
from usdmlt import parts
from usdmlt.errors import Error

AOVS = "direct,N,objectId,sampleCount,CryptoObject"


@pytest.fixture
def rendering(stage: Path) -> usdmlt.Rendering:
    """Of chains, with every kind of plane and of layer, and numbers below zero and above 2^32."""
    scene = usdmlt.load(stage, width=48)
    settings = usdmlt.Settings(integrator="mlt", samples=64, direct="mlt", aovs=AOVS)
    rendering = usdmlt.Rendering(scene, settings)
    rendering.run(until=3)
    return rendering


def with_numbers(part: parts.RenderPart) -> parts.RenderPart:
    """The part with all kinds of integers as sums."""
    numbers = np.random.default_rng(5)
    sums = {
        name: numbers.integers(-(2**63), 2**63 - 1, plane.shape, np.int64)
        for name, plane in part.state.sums.items()
    }
    sums["samples"].flat[:4] = -1, 0, -(2**63), 2**63 - 1
    return parts.RenderPart(**{**vars(part), "state": parts.State(sums, part.state.saved)})


@pytest.mark.parametrize("compression", ["none", "zip", "piz", "dwaa:100"])
def test_the_integers_come_back_bit_by_bit(rendering, tmp_path, compression) -> None:
    part = with_numbers(rendering.part())
    assert set(part.state.sums) == {
        "samples",
        "splats",
        "squares",
        "splat_squares",
        "layers",
    }
    parts.write(tmp_path / "a.exr", part, compression)
    again = parts.read(tmp_path / "a.exr")
    assert again.state.sums.keys() == part.state.sums.keys()
    for name, plane in part.state.sums.items():
        assert again.state.sums[name].dtype == np.int64
        np.testing.assert_array_equal(again.state.sums[name], plane, err_msg=name)
    assert again.state.units == [(0, 3)]
    assert again.fingerprint == rendering.fingerprint
    assert again.development == part.development
    for name, pixels in part.image.channels.items():
        np.testing.assert_array_equal(again.image[name], pixels, err_msg=name)
        assert again.image.layer(name) == part.image.layer(name)


def test_a_read_part_gives_the_render_back(rendering, tmp_path, stage) -> None:
    parts.write(tmp_path / "a.exr", rendering.part())
    other = usdmlt.Rendering(rendering.scene, rendering.settings)
    other.add(parts.read(tmp_path / "a.exr").state)
    assert rendering.run() and other.run()
    first, second = rendering.image(), other.image()
    for name, pixels in first.channels.items():
        np.testing.assert_array_equal(second[name], pixels, err_msg=name)


def test_a_part_is_a_picture_for_who_reads_it_as_one(rendering, tmp_path) -> None:
    parts.write(tmp_path / "a.exr", rendering.part())
    image = usdmlt.read_image(tmp_path / "a.exr")
    assert set(image.channels) == set(rendering.image().channels)
    np.testing.assert_array_equal(image["color"], rendering.image()["color"])
    reader = oiio.ImageInput.open(str(tmp_path / "a.exr"))
    reader.seek_subimage(1, 0)
    assert reader.spec().format == oiio.TypeDesc("uint")


def test_other_readers_of_exr_see_picture_and_words(rendering, tmp_path) -> None:
    openexr = pytest.importorskip("OpenEXR")
    parts.write(tmp_path / "a.exr", rendering.part())
    file = openexr.File(str(tmp_path / "a.exr"), separate_channels=True)
    names = [part.name() for part in file.parts]
    assert names[0] == "picture"
    assert names[1:] == [f"film.{name}" for name in rendering.state().sums]
    color = rendering.image()["color"]
    np.testing.assert_array_equal(file.parts[0].channels["R"].pixels, color[..., 0])
    samples = rendering.state().sums["samples"][..., 4]
    words = file.parts[names.index("film.samples")].channels
    assert {channel.pixels.dtype.name for channel in words.values()} == {"uint32"}
    np.testing.assert_array_equal(words["004.low"].pixels, samples)
    np.testing.assert_array_equal(words["004.high"].pixels, 0)


def test_a_truncated_part_is_refused(rendering, tmp_path) -> None:
    whole = tmp_path / "whole.exr"
    parts.write(whole, rendering.part(), "none")
    content = whole.read_bytes()
    cut = tmp_path / "cut.exr"
    numbers = random.Random(1)
    sizes = {0, 1, 3, 100, len(content) // 2, len(content) - 100, len(content) - 78}
    sizes |= {len(content) - 1} | {numbers.randrange(len(content)) for _ in range(20)}
    for size in sizes:
        cut.write_bytes(content[:size])
        with pytest.raises(Error, match="cannot read"):
            parts.read(cut)


def test_a_part_with_a_flipped_bit_is_refused(rendering, tmp_path) -> None:
    """Anywhere: in the header, a picture, a sum, an offset or the checksum."""
    whole = tmp_path / "whole.exr"
    parts.write(whole, rendering.part())
    content = bytearray(whole.read_bytes())
    numbers = random.Random(2)
    positions = {0, 8, 200, len(content) - 1, len(content) - 78}
    positions |= {numbers.randrange(len(content)) for _ in range(200)}
    flipped = tmp_path / "flipped.exr"
    for position in positions:
        bit = 1 << numbers.randrange(8)
        content[position] ^= bit
        flipped.write_bytes(content)
        content[position] ^= bit
        with pytest.raises(Error, match="cannot read"):
            parts.read(flipped)


@pytest.mark.parametrize("content", [b"", b"no picture", bytes(5000)])
def test_what_is_no_part_is_refused(tmp_path, content) -> None:
    path = tmp_path / "a.exr"
    path.write_bytes(content)
    with pytest.raises(Error, match=r"cannot read .*a\.exr"):
        parts.read(path)
    with pytest.raises(Error, match=r"cannot read .*no\.exr: No such file"):
        parts.read(tmp_path / "no.exr")


def test_a_picture_is_no_part(rendering, tmp_path) -> None:
    rendering.image().write(tmp_path / "a.exr")
    with pytest.raises(Error, match="a picture only"):
        parts.read(tmp_path / "a.exr")


def test_a_full_disk_leaves_the_file_as_it_was(rendering, tmp_path) -> None:
    """The limit of a file's size stands for the disk's: writing fails in the same way."""
    path = tmp_path / "a.exr"
    parts.write(path, rendering.part(), "none")
    before = path.read_bytes()
    for limit in (10, len(before) // 2, len(before) - 4000, len(before) - 300, len(before) - 10):
        with limited_files(limit), pytest.raises(Error, match=r"cannot write .*a\.exr"):
            parts.write(path, rendering.part(), "none")
        assert path.read_bytes() == before
        assert [p.name for p in tmp_path.glob("*.exr")] == ["a.exr"]
        assert [p.name for p in tmp_path.glob(".*")] == []


class limited_files:
    """Files may not be larger, in this process."""

    def __init__(self, size: int) -> None:
        self.size = size

    def __enter__(self) -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (self.size, resource.RLIM_INFINITY))

    def __exit__(self, *_: object) -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY,) * 2)


def test_a_file_that_takes_the_place_of_another_is_on_the_disk_first(
    rendering, tmp_path, monkeypatch
) -> None:
    """Synchronised, then renamed, then the folder: a loss of power leaves the old or the new."""
    import os

    events = []
    sync, replace = os.fsync, os.replace
    monkeypatch.setattr(
        os, "fsync", lambda d: (events.append(os.readlink(f"/proc/self/fd/{d}")), sync(d))
    )
    monkeypatch.setattr(os, "replace", lambda a, b: (events.append("rename"), replace(a, b)))
    parts.write(tmp_path / "a.exr", rendering.part())
    assert events == [str(tmp_path / ".a.partial.exr"), "rename", str(tmp_path)]


def test_reading_a_part_needs_no_stage_and_no_scene(rendering, tmp_path) -> None:
    parts.write(tmp_path / "a.exr", rendering.part())
    code = (
        "import sys; from usdmlt import parts; parts.read(sys.argv[1]); print('pxr' in sys.modules)"
    )
    command = [sys.executable, "-c", code, str(tmp_path / "a.exr")]
    assert subprocess.run(command, capture_output=True, text=True).stdout == "False\n"
