"""Sets of work units as ranges."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from usdmlt import units
from usdmlt.errors import UsageError

SETS = st.sets(st.integers(0, 40), max_size=30)


def ranges_of(members: set[int]) -> list[units.Range]:
    return units.joined((unit, unit + 1) for unit in members)


def members_of(ranges: list[units.Range]) -> set[int]:
    return {unit for first, last in ranges for unit in range(first, last)}


@given(SETS)
def test_joined_ranges_are_the_same_set_and_as_few_as_can_be(members: set[int]) -> None:
    ranges = ranges_of(members)
    assert members_of(ranges) == members
    assert units.count(ranges) == len(members)
    assert all(a[1] < b[0] for a, b in pairwise(ranges))


@given(SETS, st.integers(0, 45), st.integers(0, 45))
def test_gaps_are_what_is_wanted_and_not_there(members: set[int], first: int, last: int) -> None:
    missing = units.gaps((first, last), ranges_of(members))
    assert members_of(missing) == set(range(first, last)) - members
    assert missing == units.joined(missing)


@given(SETS, SETS)
def test_an_overlap_is_found_if_there_is_one(a: set[int], b: set[int]) -> None:
    both = units.overlap(ranges_of(a), ranges_of(b))
    if both is None:
        assert not a & b
    else:
        assert members_of([both]) <= a & b


@pytest.mark.parametrize("total", [1, 7, 8, 1000])
def test_chunks_of_a_render_are_all_of_it(total: int) -> None:
    chunks = []
    for number in range(8):
        try:
            chunks.append(units.resolve(f"{number}/8", total))
        except UsageError:
            assert total < 8  # some chunks of a few units are empty
    assert units.joined(chunks) == [(0, total)]


@pytest.mark.parametrize("text", ["", "5", "5:5", "6:5", "-1:4", "8/8", "1:2:3", "a:b", "0:1001"])
def test_what_is_no_chunk_is_a_usage_error(text: str) -> None:
    with pytest.raises(UsageError, match="--units"):
        units.resolve(text, 1000)


def test_many_ranges_are_described_by_the_first_few() -> None:
    assert units.describe([(0, 64), (128, 192)]) == "0:64, 128:192"
    assert units.describe([(i, i + 1) for i in range(0, 20, 2)]).endswith("8:9 and 5 more")
