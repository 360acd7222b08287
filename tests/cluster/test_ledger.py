"""The account of units: whatever happens to workers, each unit is in one place, and once in the
end."""

from __future__ import annotations

import random
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from usdmlt.cluster.ledger import MOST_LOSSES, Ledger
from usdmlt.errors import Error
from usdmlt.units import count, gaps, joined

WORKERS = ("a", "b", "c")


def units_in(ledger: Ledger) -> list[tuple[int, int]]:
    """All that the ledger accounts for; raises where a unit is in two places."""
    ranges = [range for range, _ in ledger._pending]
    ranges += [lease.units for lease in ledger.leases]
    ranges += [range for item in ledger.sums for range in item.units]
    together = joined(ranges)
    assert count(together) == count(ranges)
    for a, b in pairwise(together):
        assert a[1] < b[0], "a unit is in two places"
    return together


@settings(max_examples=200, deadline=None)
@given(st.integers(0, 2**32), st.integers(1, 60))
def test_no_unit_is_lost_or_counted_twice_whatever_happens(seed: int, total: int) -> None:
    """Random leases, second attempts, answers, late ones too, sums, collections and losses."""
    numbers = random.Random(seed)
    ledger = Ledger([(0, total)])
    collected: list[tuple[int, int]] = []
    age = 0

    def step(may_fail: bool) -> None:
        nonlocal age
        actions = ["lease", "again", "settle", "pair", "made", "collect", "age"]
        actions += ["lose", "fail", "undo"] if may_fail else []
        action = numbers.choice(actions)
        leases = sorted(ledger.leases, key=lambda lease: lease.units)
        whole = [s for s in sorted(ledger.sums, key=lambda s: s.units) if not s.of]
        making = [s for s in sorted(ledger.sums, key=lambda s: s.units) if s.of]
        if action == "lease" and ledger.pending:
            lease = ledger.lease(numbers.randint(1, 9), 0.0)
            lease.losses = 0
            lease.attempts[numbers.choice(WORKERS)] = object()
        elif action == "again" and leases:
            numbers.choice(leases).attempts[numbers.choice(WORKERS)] = object()
        elif action == "settle" and leases:
            lease = numbers.choice(leases)
            ledger.settle(lease, numbers.choice(sorted(lease.attempts)), age)
        elif action == "pair" and len(whole) > 1:
            ledger.pair(*numbers.sample(whole, 2), object())
        elif action == "made" and making:
            ledger.made(numbers.choice(making))
        elif action == "undo" and making:
            ledger.undo(numbers.choice(making))
        elif action == "collect" and whole:
            item = numbers.choice(whole)
            if may_fail and numbers.random() < 0.3:
                ledger.drop(item)
            else:
                ledger.sums.discard(item)
                collected.extend(item.units)
        elif action == "age":
            age += 1
        elif action == "lose":
            ledger.lose(numbers.choice(WORKERS))
        elif action == "fail" and leases:
            lease = numbers.choice(leases)
            ledger.fail(lease, numbers.choice(sorted(lease.attempts)))

    for _ in range(200):
        step(may_fail=True)
        assert joined([*units_in(ledger), *collected]) == [(0, total)]
    for _ in range(100 * total):
        if not ledger.pending and not ledger.leases and not ledger.sums:
            break
        step(may_fail=False)
    assert joined(collected) == [(0, total)]
    assert count(collected) == total


def test_what_is_lost_comes_first_again() -> None:
    ledger = Ledger([(0, 10)])
    for worker in "ab":
        ledger.lease(3, 0.0).attempts[worker] = object()
    ledger.lose("a")
    assert ledger.lease(5, 0.0).units == (0, 3)
    assert ledger.lease(5, 0.0).units == (6, 10)


def test_a_closed_ledger_leaves_no_gaps() -> None:
    ledger = Ledger([(0, 10)])
    for worker in "ab":
        ledger.lease(3, 0.0).attempts[worker] = object()
    ledger.lose("a")
    ledger.close(0)
    assert ledger.pending == 3
    assert ledger.lease(9, 0.0).units == (0, 3)
    assert gaps((0, 6), units_in(ledger)) == []


def test_what_nobody_has_begun_with_is_not_waited_for() -> None:
    ledger = Ledger([(4, 20)])
    first, second = ledger.lease(3, 0.0), ledger.lease(3, 0.0)
    first.attempts["a"] = second.attempts["a"] = object()
    ledger.withdraw(second)
    ledger.close(4)
    assert ledger.pending == 0
    assert units_in(ledger) == [(4, 7)]


def test_an_answer_that_came_first_takes_the_others_rights() -> None:
    ledger = Ledger([(0, 4)])
    lease = ledger.lease(4, 0.0)
    first, second = object(), object()
    lease.attempts.update(a=first, b=second)
    item = ledger.settle(lease, "b", 0)
    assert item.future is second and lease not in ledger.leases
    assert lease.attempts == {"a": first}  # to be cancelled
    ledger.fail(lease, "a")
    assert ledger.pending == 0


def test_units_that_take_one_worker_after_the_other_along_end_the_render() -> None:
    ledger = Ledger([(5, 8)])
    for _ in range(MOST_LOSSES - 1):
        ledger.lease(3, 0.0).attempts["a"] = object()
        ledger.lose("a")
    ledger.lease(3, 0.0).attempts["a"] = object()
    with pytest.raises(Error, match=r"units 5:8 were lost with 6 workers in turn.*memory"):
        ledger.lose("a")


def test_a_sum_that_is_being_made_falls_back_on_what_is_left_of_it() -> None:
    ledger = Ledger([(0, 4)])
    sums = []
    for worker in "ab":
        lease = ledger.lease(2, 0.0)
        lease.attempts[worker] = object()
        sums.append(ledger.settle(lease, worker, 0))
    ledger.pair(*sums, object())
    ledger.lose("b")
    assert [item.units for item in ledger.sums] == [[(0, 2)]]
    assert ledger.lease(9, 0.0).units == (2, 4)
