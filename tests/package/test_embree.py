"""Where Embree is found."""

from __future__ import annotations

import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest

from usdmlt import Error, embree


def test_it_is_in_the_wheel_of_embreex_and_loads_by_its_path() -> None:
    """In a process of its own, so that nothing else has loaded what it depends on."""
    code = (
        "import ctypes, sys; from usdmlt.embree import find_library; "
        "library = ctypes.CDLL(str(find_library())); assert library.rtcNewDevice; "
        "assert 'embreex' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_the_variable_overrides_it(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "libembree4.so").touch()
    monkeypatch.setenv("USDMLT_EMBREE", str(tmp_path / "libembree4.so"))
    assert embree.find_library() == (tmp_path / "libembree4.so").resolve()


def test_a_variable_that_names_no_file_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("USDMLT_EMBREE", "/none/libembree4.so")
    with pytest.raises(Error, match="USDMLT_EMBREE names /none"):
        embree.find_library()


def test_without_embreex_the_error_names_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> None:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.delenv("USDMLT_EMBREE", raising=False)
    monkeypatch.setattr(metadata, "distribution", missing)
    with pytest.raises(Error, match="pip install embreex"):
        embree.find_library()


@pytest.mark.parametrize(
    ("file", "is_embree"),
    [
        ("embreex.libs/libembree4-4aef3270.so.4", True),
        ("embreex/.dylibs/libembree4.4.dylib", True),
        ("embreex.libs/embree4.dll", True),
        ("embreex.libs/embree4-9f8a.dll", True),
        ("embreex.libs/libembree3-ab12.so.3", False),
        ("embreex.libs/libtbb-dcf63f8c.so.12", False),
        ("embreex/rtcore.cpython-311-x86_64-linux-gnu.so", False),
    ],
)
def test_names_of_the_library_on_all_systems(
    file: str, is_embree: bool, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    class Wheel:
        version = "4.4.0"
        files = (metadata.PackagePath(file),)

        def locate_file(self, path: metadata.PackagePath) -> Path:
            return tmp_path / path

    (tmp_path / file).parent.mkdir(parents=True)
    (tmp_path / file).touch()
    monkeypatch.delenv("USDMLT_EMBREE", raising=False)
    monkeypatch.setattr(metadata, "distribution", lambda name: Wheel())
    if is_embree:
        assert embree.find_library() == (tmp_path / file).resolve()
    else:
        with pytest.raises(Error, match="contains no Embree 4"):
            embree.find_library()
