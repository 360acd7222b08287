"""Media of scene descriptions that are made in Python: what cannot be is refused by name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import usdmlt
from usdmlt import scene as s
from usdmlt.media import check_media

GRID = s.Grid(np.ones((2, 3, 4), np.float32))
TRIANGLE = {"points": np.eye(3, dtype=np.float32), "triangles": np.array([[0, 1, 2]], np.int32)}


def test_media_that_can_be_pass() -> None:
    hot = replace(GRID, emission=np.zeros((2, 3, 4, 3), np.float32))
    media = [
        s.Medium(),
        s.Medium((1, 2, 3), phase="rayleigh"),
        s.Medium(grid=GRID),
        s.Medium(grid=hot),
    ]
    check_media(s.Scene(media=media, world_medium=3))


def test_albedo_and_mean_free_path_are_coefficients() -> None:
    medium = s.Medium.from_albedo((1, 0.5, 0), (2, 0.5, 4), anisotropy=0.3)
    assert medium == s.Medium((0.5, 1, 0), (0, 1, 0.25), anisotropy=0.3)
    check_media(s.Scene(media=[medium]))


@pytest.mark.parametrize(
    ("medium", "says"),
    [
        (s.Medium((1, -2, 3)), r"scattering is \(1.0, -2.0, 3.0\); it must be finite and at least"),
        (s.Medium(absorption=(0, np.inf, 0)), "absorption is .*finite"),
        (s.Medium(emission=(np.nan, 0, 0)), "emission is .*finite"),
        (s.Medium(scattering=(1, 2)), r"scattering is \(1, 2\), not three numbers"),
        (s.Medium(scattering=1.0), "scattering is 1.0, not three numbers"),
        (s.Medium(scattering="thick"), "medium 'm': "),
        (s.Medium(anisotropy=1.0), "anisotropy is 1; it must be between -1 and 1"),
        (s.Medium(anisotropy=-1.5), "anisotropy is -1.5"),
        (s.Medium(anisotropy=np.nan), "anisotropy is nan"),
        (s.Medium(phase="mie"), "phase 'mie' is none of henyey_greenstein, rayleigh"),
    ],
)
def test_media_that_cannot_be_are_named(medium: s.Medium, says: str) -> None:
    medium.name = "m"
    with pytest.raises(ValueError, match=says) as raised:
        check_media(s.Scene(media=[medium]))
    assert str(raised.value).startswith("medium 'm': ")


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"values": np.full((2, 2, 2), np.nan)}, "the grid has values that are not finite"),
        ({"values": np.full((2, 2, 2), -1.0)}, "the grid has values below 0, down to -1"),
        ({"values": np.ones((2, 2))}, r"the grid is \(2, 2\), not \(nx, ny, nz\)"),
        ({"values": np.ones((0, 2, 2))}, r"the grid is \(0, 2, 2\)"),
        ({"values": np.array([[["a"]]])}, "the grid holds <U1, not numbers"),
        ({"emission": np.ones((2, 3, 4))}, r"emission is \(2, 3, 4\), not \(nx, ny, nz, 3\)"),
        ({"emission": np.ones((2, 3, 5, 3))}, "does not fit"),
        ({"emission": np.full((2, 3, 4, 3), np.inf)}, "emission has values that are not finite"),
        ({"upper": (0.5, -0.5, 0.5)}, "has no volume"),
        ({"lower": (np.nan, 0, 0)}, "has no volume"),
        ({"transform": np.zeros((4, 4))}, "the grid's transform is singular"),
    ],
)
def test_grids_that_cannot_be_are_named(changes: dict, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        check_media(s.Scene(media=[s.Medium(grid=replace(GRID, **changes))]))


@pytest.mark.parametrize(
    ("scene", "says"),
    [
        (s.Scene(world_medium=0), "the world holds medium 0, of 0"),
        (s.Scene(meshes=[s.Mesh(**TRIANGLE, medium=1, name="a")]), "mesh 'a' holds medium 1, of 0"),
        (s.Scene(volumes=[s.Volume(**TRIANGLE, medium=-1)]), "volume '' holds medium -1"),
        (
            s.Scene(prototypes=[s.Prototype([s.Mesh(**TRIANGLE, medium=5, name="p")])]),
            "mesh 'p' holds medium 5",
        ),
    ],
)
def test_media_that_are_not_there_are_named(scene: s.Scene, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        check_media(scene)


@pytest.mark.parametrize("field", ["meshes", "volumes"])
def test_what_holds_a_medium_has_to_be_closed(field: str) -> None:
    kind = s.Mesh if field == "meshes" else s.Volume
    scene = s.Scene(media=[s.Medium()], **{field: [kind(**TRIANGLE, medium=0, name="a")]})
    with pytest.raises(ValueError, match=f"{kind.__name__.lower()} 'a' holds a medium and is not"):
        check_media(scene)


def test_a_render_says_so_too() -> None:
    with pytest.raises(usdmlt.Error, match="medium 'fog': anisotropy is 2"):
        usdmlt.render(s.Scene(media=[s.Medium(anisotropy=2.0, name="fog")]), samples=1)
