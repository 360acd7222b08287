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
    """The module, in the variant that needs nothing: with an LLVM older than it expects, which the
    system may have, the vectorised one aborts the process."""
    mitsuba = pytest.importorskip("mitsuba")
    mitsuba.set_variant("scalar_rgb")
    return mitsuba
