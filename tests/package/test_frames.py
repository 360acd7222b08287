"""Frame specifications and placeholders, as usdrecord has them."""

from __future__ import annotations

import pytest

from usdmlt.cli.frames import check_placeholder, frame_path, parse_frames


@pytest.mark.parametrize(
    ("specification", "frames"),
    [
        ("123", [123]),
        ("101:105", [101, 102, 103, 104, 105]),
        ("105:101", [105, 104, 103, 102, 101]),
        ("101:109x2", [101, 103, 105, 107, 109]),
        ("101:102x0.5", [101, 101.5, 102]),
        ("7, 1:2,-3", [7, 1, 2, -3]),
    ],
)
def test_specifications(specification: str, frames: list[float]) -> None:
    assert parse_frames(specification) == frames


@pytest.mark.parametrize("specification", ["", "a", "1:2:3", "1:3x0", "1:3x-1", "nan", "1,,2"])
def test_malformed_specifications_are_refused(specification: str) -> None:
    with pytest.raises(ValueError, match="is not start"):
        parse_frames(specification)


def test_more_frames_than_anyone_renders_are_refused() -> None:
    with pytest.raises(ValueError, match=r"frames '1:1e9' are more than 1000000"):
        parse_frames("3,1:1e9")


def test_strides_without_an_exact_sum_have_file_names() -> None:
    frames = parse_frames("1:2x0.1")
    assert any(frame != round(frame, 1) for frame in frames)
    check_placeholder("shot.###.#.exr", frames)
    assert frame_path("shot.###.#.exr", frames[7]) == "shot.001.7.exr"


@pytest.mark.parametrize(
    ("path", "frame", "expected"),
    [
        ("shot.###.exr", 7, "shot.007.exr"),
        ("shot.#.exr", 1234, "shot.1234.exr"),
        ("shot.####.exr", -3, "shot.-003.exr"),
        ("d#r/shot.###.#.exr", 1.5, "d#r/shot.001.5.exr"),
    ],
)
def test_placeholders_become_the_frame_number(path: str, frame: float, expected: str) -> None:
    assert frame_path(path, frame) == expected


@pytest.mark.parametrize(
    ("path", "frames", "complaint"),
    [
        ("shot.exr", [1.0], "needs one placeholder"),
        ("a##.b##.exr", [1.0], "more than one placeholder"),
        ("shot.##.exr", None, "no --frames"),
        ("shot.##.exr", [1.0, 1.5], "cannot show frame 1.5"),
        ("shot.##.#.exr", [1.25], "cannot show frame 1.25"),
    ],
)
def test_paths_that_do_not_fit_the_frames(
    path: str, frames: list[float] | None, complaint: str
) -> None:
    with pytest.raises(ValueError, match=complaint):
        check_placeholder(path, frames)
