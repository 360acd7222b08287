"""What workers run: units of a plan that they make themselves, of a scene that was sent to them.

Importing this loads nothing heavy: the scheduler does it too.
"""

from __future__ import annotations

import threading
from collections import OrderedDict
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from usdmlt.fingerprint import Fingerprint
    from usdmlt.parts import State
    from usdmlt.rendering import Rendering
    from usdmlt.settings import Settings

# A process renders for one task at a time, with all threads of the worker, and keeps the scene of
# one picture beside that of the next.
_lock = threading.Lock()
_renderings: OrderedDict[str, Rendering] = OrderedDict()
_KEPT = 2


class Mismatch(Exception):
    """The worker's plan has other bits than the client's."""


class Unprepared(Exception):
    """The worker has not, or no more, what it was to render."""


@dataclass(frozen=True)
class Plan:
    """What is rendered: settings as resolved, and the fingerprint that has to come out."""

    key: str
    settings: Settings
    fingerprint: Fingerprint


def prepare(plan: Plan, packed: bytes, *buffers: Any) -> None:
    """Make the plan. Only this needs the scene: what other workers may have, and keep to themselves
    when they are paused, no task waits for that has units."""
    with _lock:
        _rendering(plan, packed, buffers)


def render_units(plan: Plan, first: int, last: int) -> State:
    """Render the units ``first`` to ``last`` - 1 alone."""
    from distributed import get_worker

    threads = get_worker().state.nthreads
    with _lock:
        if plan.key not in _renderings:
            raise Unprepared
        _renderings.move_to_end(plan.key)
        return _renderings[plan.key].render_alone(first, last, threads)


def add(a: State, b: State) -> State:
    """The sum of two states, whose units must not overlap."""
    from usdmlt import parts, units

    both = units.overlap(a.units, b.units)
    if both:
        raise ValueError(f"units {both[0]}:{both[1]} are in both sums")
    sums = {name: plane + b.sums[name] for name, plane in a.sums.items()}
    return parts.State(sums, parts.added(a.saved, b.saved))


def _rendering(plan: Plan, packed: bytes, buffers: tuple[Any, ...]) -> Rendering:
    from usdmlt import fingerprint
    from usdmlt.cluster.shipping import unpacked
    from usdmlt.rendering import Rendering

    if plan.key in _renderings:
        _renderings.move_to_end(plan.key)
        return _renderings[plan.key]
    while len(_renderings) >= _KEPT:
        _renderings.popitem(last=False)
    rendering = Rendering(unpacked(packed, list(buffers)), plan.settings)
    difference = fingerprint.difference(rendering.fingerprint, plan.fingerprint)
    if difference:
        raise Mismatch(difference)
    _renderings[plan.key] = rendering
    return rendering
