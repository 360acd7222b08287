"""Renders on a real scheduler and real workers: the bits of one machine, whatever happens."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

import usdmlt
from usdmlt import cluster as on_cluster
from usdmlt import parts
from usdmlt.checkpoint import Checkpoint
from usdmlt.cluster.picture import Picture
from usdmlt.cluster.rendering import pictures
from usdmlt.errors import Error

# Schedulers and workers of their own: minutes, and whatever else the machine does matters.
pytestmark = pytest.mark.slow


def assert_same(there: usdmlt.Rendering, here: usdmlt.Rendering) -> None:
    """The same units, each once: the same integers, floats and counts."""
    assert there.units == here.units
    for name, plane in here.state().sums.items():
        np.testing.assert_array_equal(there.state().sums[name], plane, err_msg=name)
    a, b = there.image(), here.image()
    for name, pixels in b.channels.items():
        np.testing.assert_array_equal(a[name], pixels, err_msg=name)
    assert a.stats["rays"] == b.stats["rays"]
    assert a.stats["samples"] == b.stats["samples"]
    if here.integrator == "mlt":
        assert a.stats["mutations"] == b.stats["mutations"]
        assert a.stats["path_class_energy"] == b.stats["path_class_energy"]


class Script:
    """Things to do when so much of a render is done."""

    def __init__(self, *steps: tuple[float, Callable[[], object]]) -> None:
        self.steps = list(steps)

    def __call__(self, progress: usdmlt.Progress) -> None:
        while self.steps and progress.units_done >= self.steps[0][0] * progress.units_total:
            self.steps.pop(0)[1]()


@pytest.mark.parametrize("integrator", ["path", "bdpt", "mlt"])
def test_four_workers_give_the_bits_of_one_machine(cluster, plan, integrator) -> None:
    for name in "abcd":
        cluster.add(name)
    work = {"path": 60, "bdpt": 20, "mlt": 400}
    there, here = (plan(integrator=integrator, samples=work[integrator]) for _ in range(2))
    told: list[usdmlt.Progress] = []
    with cluster.client(4) as client:
        on_cluster.render(client, there, told.append)
    here.run()
    assert_same(there, here)
    assert told[-1].units_done == told[-1].units_total == there.units_total
    assert told[-1].units_done >= told[0].units_done


def assert_two_workers_render(cluster, plan, samples: int) -> None:
    there, here = plan(samples=samples), plan(samples=samples)
    with cluster.client(2) as client:
        on_cluster.render(client, there)
    here.run()
    assert_same(there, here)


def test_workers_are_killed_added_and_paused(cluster, plan) -> None:
    """The paused one is declared lost, goes on and answers: too late to count."""
    for name in "abcd":
        cluster.add(name)
    there = plan(samples=1800)
    script = Script(
        (0.05, lambda: cluster.kill("a")),
        (0.10, lambda: cluster.pause("b")),
        (0.15, lambda: cluster.add("e")),
        (0.60, lambda: cluster.go_on("b")),
        (0.70, lambda: cluster.kill("c")),
    )
    with cluster.client(4) as client:
        picture = Picture(there, progress=script)
        assert [done.failure for done in pictures(client, [picture], patience=2.0)] == [None]
    assert not script.steps
    here = plan(samples=1800)
    here.run()
    assert_same(there, here)


def test_a_worker_that_is_paused_to_the_end_is_not_waited_for(cluster, plan) -> None:
    for name in "ab":
        cluster.add(name)
    there = plan(samples=500)
    with cluster.client(2) as client:
        picture = Picture(there, progress=Script((0.4, lambda: cluster.pause("b"))))
        started = time.monotonic()
        assert [done.failure for done in pictures(client, [picture], patience=2.0)] == [None]
        assert time.monotonic() - started < 60
        cluster.go_on("b")
    here = plan(samples=500)
    here.run()
    assert_same(there, here)


def test_all_workers_can_be_lost_and_others_come(cluster, plan) -> None:
    cluster.add("a")
    there = plan(samples=400)

    def replace() -> None:
        cluster.kill("a")
        cluster.add("b", threads=2)

    with cluster.client(1) as client:
        on_cluster.render(client, there, Script((0.3, replace)))
    here = plan(samples=400)
    here.run()
    assert_same(there, here)


def test_a_checkpoint_of_a_cluster_is_resumed_here_and_the_other_way(
    cluster, plan, tmp_path
) -> None:
    cluster.add("a")
    cluster.add("b")
    first, path = plan(samples=800), tmp_path / "c.exr"
    checkpoint = Checkpoint(path, seconds=0.5)
    written = []
    stop = lambda: bool(written) and first.units_done > 0  # noqa: E731
    update = checkpoint.update
    checkpoint.update = lambda r: (update(r), written.append(r.units_done))  # type: ignore
    with cluster.client(2) as client:
        on_cluster.render(client, first, None, stop, checkpoint=checkpoint)
        checkpoint.write(first)
        assert 0 < first.units_done < first.units_total
        assert first.units == [(0, first.units_done)]  # what was handed out is finished
        second = plan(samples=800)
        second.add(parts.read(path).state)
        second.run(until=second.units_done + 2)
        assert second.units_done < second.units_total
        on_cluster.render(client, second)
    here = plan(samples=800)
    here.run()
    assert_same(second, here)


def test_pictures_share_workers_and_one_that_fails_takes_none_along(
    cluster, plan, monkeypatch
) -> None:
    """The second picture's units cannot be rendered by anyone."""
    for name in "ab":
        cluster.add(name)
    made = [plan(samples=200, seed=seed) for seed in range(3)]
    tampered = Picture(made[1])
    begin = tampered.begin

    def begin_without_materials(client, crew, scene, watch) -> None:
        from toolz import identity

        begin(client, crew, scene, watch)
        tampered._scene = [client.submit(identity, b"no scene", pure=False)]
        monkeypatch.setattr(crew, "refuse", refuse)

    def refuse(address: str, reason: str) -> None:
        tampered.failure = Error(reason)

    monkeypatch.setattr(tampered, "begin", begin_without_materials)
    wanted: Iterator[Picture] = iter([Picture(made[0]), tampered, Picture(made[2])])
    with cluster.client(2) as client:
        done = list(pictures(client, wanted))
    assert [picture.failure is None for picture in sorted(done, key=lambda p: p is tampered)] == [
        True,
        True,
        False,
    ]
    for number in (0, 2):
        here = plan(samples=200, seed=number)
        here.run()
        assert_same(made[number], here)


def test_a_time_limit_ends_a_render_on_a_cluster(cluster, plan) -> None:
    cluster.add("a")
    there = plan(samples=2**20, time=2.0)
    with cluster.client(1) as client:
        started = time.monotonic()
        on_cluster.render(client, there)
        assert time.monotonic() - started < 30
    assert 0 < there.units_done < there.units_total
    here = plan(samples=2**20)
    here.run(until=there.units_done)
    assert_same(there, here)


def test_a_target_error_ends_a_render_where_it_would_end_here(cluster, plan) -> None:
    cluster.add("a")
    cluster.add("b")
    there, here = (plan(samples=None, target_error=0.05) for _ in range(2))
    told: list[usdmlt.Progress] = []
    with cluster.client(2) as client:
        on_cluster.render(client, there, told.append)
    here.run()
    assert here.units_done < here.units_total
    assert_same(there, here)
    assert told[-1].units_done == told[-1].units_total == here.units_done
    half = next(made for made in told if made.units_done >= here.units_done / 2)
    assert half.units_done / half.units_total == pytest.approx(0.5, abs=0.1)


def test_the_loss_of_the_scheduler_is_an_error_and_no_loss_of_what_was_collected(
    cluster, plan, tmp_path
) -> None:
    cluster.add("a")
    there = plan(samples=2**18)
    checkpoint = Checkpoint(tmp_path / "c.exr", seconds=0.5)

    def lose(progress: usdmlt.Progress) -> None:
        if (tmp_path / "c.exr").exists():
            cluster.scheduler.kill()

    with cluster.client(1) as client, pytest.raises(Error, match="does not answer any more"):
        on_cluster.render(client, there, lose, checkpoint=checkpoint)
    state = parts.read(tmp_path / "c.exr").state
    assert state.units[0][1] > 0
    here = plan(samples=2**18)
    here.run(until=state.units[0][1])
    for name, plane in here.state().sums.items():
        np.testing.assert_array_equal(state.sums[name], plane)


# -- workers that cannot be used ----------------------------------------------------------------


def package(folder: Path, name: str, text: str) -> Path:
    """A folder of modules that goes before all others."""
    path = folder / "modules" / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path.parent


@pytest.mark.parametrize(
    ("module", "text", "said"),
    [
        ("usdmlt.py", "__version__ = '0.0.1'", r"it is of usdmlt 0\.0\.1, not "),
        ("usdmlt.py", "raise ImportError('none here')", "it has no usdmlt"),
        (
            "sitecustomize.py",
            "import usdmlt.native as n\nn.build_info = lambda: {'instruction_set': 'x86-64-v4'}",
            r"it is of a build for x86-64-v4, not x86-64-v3",
        ),
    ],
)
def test_workers_of_another_kind_are_refused_in_a_line(
    cluster, plan, tmp_path, module, text, said
) -> None:
    cluster.add("a", path=package(tmp_path, module, text))
    with cluster.client(1) as client, pytest.raises(Error) as raised:
        on_cluster.render(client, plan(samples=100))
    assert re.match(rf"no worker can be used: of tcp://127\.0\.0\.1:\d+, {said}", str(raised.value))


def test_a_worker_that_gives_other_bits_is_refused_and_the_others_render(
    cluster, plan, tmp_path, caplog
) -> None:
    """Its plan has another number, as on a machine whose arithmetic differs."""
    text = (
        "import usdmlt.fingerprint as f\nmade = f.of_render\n"
        "f.of_render = lambda s, t, i, l, plan: made(s, t, i, l, plan + 1)\n"
    )
    cluster.add("wrong", path=package(tmp_path, "sitecustomize.py", text))
    cluster.add("right")
    assert_two_workers_render(cluster, plan, 600)
    assert "is not used: its pilots measured something else" in caplog.text


OUT_OF_MEMORY = """
import usdmlt.rendering as r
render, left = r.Rendering.render_alone, [{count}]
def fail(*arguments):
    left[0] -= 1
    if left[0] < 0:
        raise MemoryError
    return render(*arguments)
r.Rendering.render_alone = fail
"""


def test_a_worker_that_is_out_of_memory_gets_no_more_and_nothing_is_lost(
    cluster, plan, tmp_path, caplog
) -> None:
    text = OUT_OF_MEMORY.format(count=3)
    cluster.add("small", path=package(tmp_path, "sitecustomize.py", text))
    cluster.add("large")
    assert_two_workers_render(cluster, plan, 300)
    assert "is not used: it is out of memory" in caplog.text


def test_where_all_workers_are_out_of_memory_what_was_done_is_kept(cluster, plan, tmp_path) -> None:
    text = OUT_OF_MEMORY.format(count=3)
    cluster.add("small", path=package(tmp_path, "sitecustomize.py", text))
    there = plan(samples=300)
    with (
        cluster.client(1) as client,
        pytest.raises(Error, match=r"no worker can be used: of tcp://.*, it is out of memory"),
    ):
        on_cluster.render(client, there)
    assert 0 < there.units_done < there.units_total
    here = plan(samples=300)
    here.run(until=there.units_done)
    assert_same(there, here)


def test_an_address_that_does_not_answer_is_an_error(monkeypatch) -> None:
    from usdmlt.cluster import connection

    monkeypatch.setattr(connection, "SECONDS_TO_CONNECT", 1.0)
    with (
        pytest.raises(Error, match=r"no scheduler of Dask answers at tcp://127\.0\.0\.1:9"),
        connection.connected("tcp://127.0.0.1:9"),
    ):
        pass


def test_render_takes_a_client(cluster, scene) -> None:
    cluster.add("a")
    with cluster.client(1) as client:
        there = usdmlt.render(scene, samples=8, client=client)
    here = usdmlt.render(scene, samples=8)
    np.testing.assert_array_equal(there["color"], here["color"])
    np.testing.assert_array_equal(there["error"], here["error"])


def test_what_scenes_share_is_sent_once(cluster, scene) -> None:
    from dataclasses import replace

    from usdmlt.cluster.shipping import Shipment, unpacked
    from usdmlt.inputs import Texture

    cluster.add("a")
    pixels = np.random.default_rng(1).integers(0, 255, (300, 200, 4), np.uint8)
    scenes = [replace(scene, textures=[Texture(pixels)], width=width) for width in (64, 80)]
    with cluster.client(1) as client:
        shipment = Shipment(client)
        first, second = map(shipment.send, scenes)
        assert first[0].key != second[0].key
        assert len(first) > 1
        assert [future.key for future in first[1:]] == [future.key for future in second[1:]]
        packed, *buffers = client.gather(second)
        again = unpacked(packed, buffers)
    assert again.width == 80
    np.testing.assert_array_equal(again.textures[0].pixels, pixels)
    assert len(packed) < pixels.nbytes / 4
