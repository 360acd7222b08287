"""`import usdmlt` and `usdmlt --version` load next to nothing."""

from __future__ import annotations

import subprocess
import sys

import pytest

import usdmlt

HEAVY = ("numpy", "pxr", "OpenImageIO", "colour", "rich", "usdmlt._core")


def loaded_by(code: str) -> set[str]:
    """The modules a fresh interpreter has after ``code``, and nothing on stderr."""
    code += "\nimport sys; print('\\n'.join(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr == ""
    return set(done.stdout.split())


def test_import_loads_nothing_heavy() -> None:
    assert loaded_by("import usdmlt").isdisjoint(HEAVY)


def test_what_a_scheduler_of_dask_imports_is_not_heavy() -> None:
    code = "import usdmlt.cluster.worker, usdmlt.cluster.shipping"
    assert loaded_by(code).isdisjoint({*HEAVY, "distributed"})


@pytest.mark.parametrize("arguments", [["--version"], ["--help"], ["render", "--help"]])
def test_parsing_the_command_line_loads_nothing_heavy(arguments: list[str]) -> None:
    code = (
        "import contextlib, io\n"
        "from usdmlt.cli import main\n"
        "with contextlib.suppress(SystemExit), contextlib.redirect_stdout(io.StringIO()):\n"
        f"    main({arguments!r})"
    )
    assert loaded_by(code).isdisjoint(HEAVY)


def test_public_modules_are_there_without_an_import_of_their_own() -> None:
    code = "import usdmlt; assert usdmlt.color.conversion('ACEScg', 'lin_rec709_scene')[0, 0] > 1"
    loaded = loaded_by(code)
    assert "usdmlt.color" in loaded
    assert loaded.isdisjoint({"pxr", "OpenImageIO", "colour", "rich"})


def test_every_public_name_is_there_when_asked_for() -> None:
    for name in usdmlt.__all__:
        assert getattr(usdmlt, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        _ = usdmlt.nonsense
