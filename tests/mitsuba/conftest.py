"""Mitsuba 3, if it is installed: `pip install '.[mitsuba]'`."""

from __future__ import annotations

from pathlib import Path

import pytest


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    here = Path(__file__).parent
    for item in items:
        if here in item.path.parents:
            item.add_marker(pytest.mark.mitsuba)


@pytest.fixture(scope="session")
def mi():
    """The module: vectorised where LLVM is found, else in the variant that needs nothing."""
    mitsuba = pytest.importorskip("mitsuba")
    drjit = pytest.importorskip("drjit")
    vectorised = drjit.has_backend(drjit.JitBackend.LLVM)
    mitsuba.set_variant("llvm_ad_rgb" if vectorised else "scalar_rgb")
    return mitsuba
