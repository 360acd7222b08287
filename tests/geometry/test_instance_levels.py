"""What the build of Embree can do: one level of instances, which is why nesting is flattened."""

from __future__ import annotations

from usdmlt import native
from usdmlt.embree import find_library


def test_embree_follows_one_level_of_instances() -> None:
    """A ray into an instance of an instance misses without an error. Should a build follow two
    levels, instances of instances need not be flattened any more."""
    assert native.core().embree_instance_levels(str(find_library())) == 1


def test_the_probe_can_tell_none_from_one() -> None:
    assert native.core().embree_instance_levels(str(find_library()), limit=0) == 0
