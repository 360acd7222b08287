"""Workers whose memory is too small: they are killed, refuse or are paused, and nothing hangs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import usdmlt
from usdmlt import cluster as on_cluster
from usdmlt.errors import Error

# Schedulers and workers of their own: minutes, and whatever else the machine does matters.
pytestmark = pytest.mark.slow

# What a worker does instead, from the call number `left` on. Killed as by the system, of which
# nobody is told; grown beyond what its nanny allows; out of memory by the system's word.
CHANGED = """
import os, resource, signal
import usdmlt.cluster.worker as worker
import usdmlt.rendering as rendering
def kill():
    os.kill(os.getpid(), signal.SIGKILL)
kept = []
def grow(size):
    kept.append(bytearray(os.urandom(1)) * size)
def limited(function):
    def call(*arguments):
        size = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (size + 2**22, resource.RLIM_INFINITY))
        try:
            return function(*arguments)
        finally:
            resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY,) * 2)
    return call
def fail():
    raise MemoryError
def changed(function, left, change):
    def call(*arguments):
        nonlocal left
        left -= 1
        if left < 0:
            change()
        return function(*arguments)
    return call
"""
WHEN_RENDERING = "rendering.Rendering.render_alone = changed(rendering.Rendering.render_alone, {})"
WHEN_PREPARING = "worker._rendering = changed(worker._rendering, {})"
WHEN_ADDING = "worker.add = changed(worker.add, {})"


@pytest.fixture
def changed(tmp_path: Path) -> Callable[[str], Path]:
    """A folder of modules that change a worker as a line of Python says."""

    def make(line: str) -> Path:
        folder = tmp_path / "modules"
        folder.mkdir()
        (folder / "sitecustomize.py").write_text(f"{CHANGED}\n{line}\n")
        return folder

    return make


def assert_rendered(there: usdmlt.Rendering, here: usdmlt.Rendering) -> None:
    """The units that are there give the bits that they give here."""
    here.run(until=there.units_done)
    assert there.units == here.units
    for name, plane in here.state().sums.items():
        np.testing.assert_array_equal(there.state().sums[name], plane, err_msg=name)


@pytest.mark.parametrize(
    ("line", "nanny"),
    [
        (WHEN_RENDERING.format("2, kill"), False),
        (WHEN_RENDERING.format("2, lambda: grow(10**9)"), True),
        (WHEN_ADDING.format("1, kill"), False),
        (WHEN_ADDING.format("1, fail"), False),
        (WHEN_PREPARING.format("0, kill"), True),
    ],
)
def test_others_go_on_when_a_worker_has_too_little(cluster, plan, changed, line, nanny) -> None:
    cluster.add("small", path=changed(line), nanny=nanny, memory="700 MB" if nanny else "auto")
    cluster.add("large")
    there = plan(samples=600)
    with cluster.client(2) as client:
        on_cluster.render(client, there)
    assert there.units_done == there.units_total
    assert_rendered(there, plan(samples=600))


def test_memory_that_the_system_refuses_is_said(cluster, changed, caplog) -> None:
    """By a limit of the address space: there is no room for a thread's stack, nor for a film."""
    line = "rendering.Rendering.render_alone = limited(rendering.Rendering.render_alone)"
    cluster.add("small", path=changed(line))
    cluster.add("large")
    scene = usdmlt.load(Path(__file__).parents[2] / "scenes" / "cornell_box.usda", width=160)
    there, here = (
        usdmlt.Rendering(scene, usdmlt.Settings(integrator="bdpt", samples=24)) for _ in range(2)
    )
    with cluster.client(2) as client:
        on_cluster.render(client, there)
    assert "is not used: it is out of memory" in caplog.text
    assert there.units_done == there.units_total
    assert_rendered(there, here)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (
            WHEN_RENDERING.format("0, kill"),
            r"units \d+:\d+ were lost with 6 workers in turn: is th",
        ),
        (
            WHEN_ADDING.format("0, kill"),
            r"units \d+:\d+ were lost with 6 workers in turn: is their",
        ),
        (WHEN_PREPARING.format("0, kill"), "6 workers in turn were lost with the scene: is their"),
    ],
)
def test_where_all_workers_are_killed_again_and_again_it_is_an_error(
    cluster, plan, changed, line, said
) -> None:
    """Their nannies start them again each time."""
    cluster.add("small", path=changed(line), nanny=True)
    there = plan(samples=600)
    with cluster.client(1) as client, pytest.raises(Error, match=said):
        on_cluster.render(client, there)
    assert_rendered(there, plan(samples=600))


def test_a_worker_that_is_killed_when_it_is_asked_is_not_waited_for_for_ever(
    cluster, plan, changed
) -> None:
    line = "import usdmlt.fingerprint as f\nf.of_machine = changed(f.of_machine, 0, kill)"
    cluster.add("small", path=changed(line), nanny=True)
    said = "6 workers in turn were lost at once: is their memory too small"
    with cluster.client(1) as client, pytest.raises(Error, match=said):
        on_cluster.render(client, plan(samples=100))


def test_films_that_a_worker_cannot_add_are_collected_one_by_one(cluster, plan, changed) -> None:
    """What was rendered is kept, though nobody is left to render the rest."""
    cluster.add("small", path=changed(WHEN_ADDING.format("0, fail")))
    there = plan(samples=600)
    said = r"no worker can be used: of tcp://.*, it is out of memory"
    with cluster.client(1) as client, pytest.raises(Error, match=said):
        on_cluster.render(client, there)
    assert 0 < there.units_done < there.units_total
    assert_rendered(there, plan(samples=600))


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Workers that are paused are given up after three seconds."""
    monkeypatch.setattr("usdmlt.cluster.crew.PATIENCE_WHEN_PAUSED", 0.1)


@pytest.mark.usefixtures("impatient")
def test_a_worker_that_dask_pauses_is_not_waited_for(cluster, plan, changed, caplog) -> None:
    """It has more than four fifths of its memory, from its third task on."""
    path = changed(WHEN_RENDERING.format("2, lambda: grow(6 * 10**8)"))
    cluster.add("small", path=path, memory="800 MB")
    cluster.add("large")
    there = plan(samples=1500)
    with cluster.client(2) as client:
        on_cluster.render(client, there)
    assert "is paused by Dask, as its memory is nearly full" in caplog.text
    assert_rendered(there, plan(samples=1500))


@pytest.mark.usefixtures("impatient")
def test_where_dask_pauses_all_workers_it_is_an_error(cluster, plan) -> None:
    cluster.add("small", memory="60 MB")
    there = plan(samples=100)
    said = "no worker can be used: of tcp://.*, Dask has paused it, as its memory is nearly full"
    with cluster.client(0) as client, pytest.raises(Error, match=said):
        on_cluster.render(client, there)
