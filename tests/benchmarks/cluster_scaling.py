"""Where a cluster stops scaling: a simulation, with costs that are measured here.

    python tests/benchmarks/cluster_scaling.py [--hours H] [--pixels 3840x2160] [--layers 20]
        [--integrator mlt] [--gigabits 10]

The account of units is the one that renders use, and so is the length of leases; workers,
scheduler and network are simulated. Workers differ in speed by a factor of two, and one in two
hundred is lost and replaced during the render. What a task costs the scheduler and the client, and
what its message has in bytes, is measured with tasks that do nothing on a scheduler of this
machine; what the client does for each event with all its workers is measured too.
"""

from __future__ import annotations

import argparse
import heapq
import pickle
import random
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import usdmlt
from usdmlt.cluster import connection, picture, worker
from usdmlt.cluster.ledger import Ledger, Sum
from usdmlt.units import count

ROOT = Path(__file__).parents[2]
WORKERS = (1, 3, 10, 30, 100, 300, 1000, 3000)
ADD_BYTES_PER_SECOND = 2e9  # of one film added to another, in memory


@dataclass(frozen=True)
class Costs:
    """Of one task: seconds of the client and the scheduler together, and bytes of its message."""

    seconds: float
    bytes: float
    seconds_per_worker: float  # of the client, at every event


def measured_costs(tasks: int = 2000) -> Costs:
    scene = usdmlt.load(str(ROOT / "scenes" / "cornell_box.usda"), width=32)
    made = usdmlt.Rendering(scene, usdmlt.Settings(integrator="mlt", samples=1))
    plan = worker.Plan("key", made.settings, made.fingerprint)
    with connection.local(2, 2) as client:
        addresses = list(client.scheduler_info()["workers"])

        def run(count: int) -> float:
            started = perf_counter()
            futures = [
                client.submit(pickle.dumps, plan, pure=False, workers=[addresses[number % 2]])
                for number in range(count)
            ]
            for future in futures:
                future.result()
            return perf_counter() - started

        run(100)
        seconds = run(tasks) / tasks
    size = len(pickle.dumps((worker.render_units, plan, 0, 1))) + 1000
    return Costs(seconds, size, looking_costs())


def looking_costs(workers: int = 1000) -> float:
    """What it takes to go through the sums of many workers, by worker."""
    ledger = Ledger([(0, 2 * workers)])
    for number in range(workers):
        lease = ledger.lease(1, 0.0)
        lease.attempts[str(number)] = None
        ledger.settle(lease, str(number), 0)
    started = perf_counter()
    for _ in range(10):
        there = {(item.worker, False) for item in sorted(ledger.sums, key=lambda s: s.units)}
        assert len(there) == workers
        sum(count(item.units) for item in ledger.sums)
    return (perf_counter() - started) / 10 / workers


@dataclass
class Outcome:
    seconds: float
    ideal: float
    tasks: int
    busy: float  # seconds of client and scheduler
    collected: int


def simulate(
    workers: int, work: float, film: float, network: float, costs: Costs, seed: int = 1
) -> Outcome:
    """A render of ``work`` seconds of one worker of speed 1, with a film of so many bytes.

    Every event costs the client and the scheduler, which do one thing at a time; they are where the
    simulation can run late.
    """
    numbers = random.Random(seed)
    units = 1_000_000
    ledger = Ledger([(0, units)])
    speed = {w: numbers.uniform(0.7, 1.4) * units / work for w in range(workers)}
    lease_seconds = min(
        max(film * picture.SECONDS_PER_BYTE, picture.LEAST_SECONDS), picture.MOST_SECONDS
    )
    losses = sorted(numbers.uniform(0, work / workers) for _ in range(workers // 200))
    control = 0.0  # when client and scheduler are free again
    busy, tasks, collected = 0.0, 0, 0
    events: list[tuple[float, int, int, object]] = []
    number = 0

    def task(now: float) -> float:
        """When a message of now has been handled."""
        nonlocal control, busy, tasks
        cost = costs.seconds + workers * costs.seconds_per_worker
        tasks += 1
        busy += cost
        control = max(control, now) + cost
        return control

    def hand_out(now: float, w: int) -> None:
        nonlocal number
        if not ledger.pending:
            return
        share = max(
            ledger.pending / (2 * workers), speed[w] * lease_seconds * picture.SMALLEST_LEASE
        )
        size = max(round(min(speed[w] * lease_seconds, share)), 1)
        lease = ledger.lease(size, now)
        lease.attempts[str(w)] = w
        begin = task(now)
        # The film is cleared, copied and added to the worker's sum.
        seconds = (lease.units[1] - lease.units[0]) / speed[w] + 3 * film / ADD_BYTES_PER_SECOND
        number += 1
        heapq.heappush(events, (begin + seconds, number, w, lease))

    for w in range(workers):
        hand_out(0.0, w)
    now, next_collection = 0.0, picture.COLLECTED_EVERY
    of_worker: dict[int, Sum] = {}
    while events:
        now, _, w, lease = heapq.heappop(events)
        if lease not in ledger.leases:
            continue
        done = ledger.settle(lease, str(w), 0)
        if w in of_worker and of_worker[w] in ledger.sums:
            pair = ledger.pair(of_worker[w], done, None)
            pair.of = ()
            done = pair
            task(now)
        of_worker[w] = done
        if losses and now > losses[0]:
            losses.pop(0)
            ledger.lose(str(numbers.randrange(workers)))
        hand_out(max(now, control), w)
        if now > next_collection:
            # Workers go on meanwhile; the client waits for the film, twice on its way.
            next_collection = max(now, control) + picture.COLLECTED_EVERY
            collected += 1
            ledger.sums.clear()
            of_worker.clear()
            control = max(now, control) + 2 * film / network
            for _ in range(workers):
                task(now)
    end = max(now, control) + tree(workers, film, network)
    return Outcome(end, units / sum(speed.values()), tasks, busy, collected + 1)


def tree(workers: int, film: float, network: float) -> float:
    """Seconds of the last collection: films are added in pairs, and the sum comes to the client by
    way of the scheduler."""
    levels = (workers - 1).bit_length()
    return levels * (film / network + film / ADD_BYTES_PER_SECOND) + 2 * film / network


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, default=1000.0, help="of one worker")
    parser.add_argument("--pixels", default="3840x2160")
    parser.add_argument("--layers", type=int, default=20)
    parser.add_argument("--integrator", choices=("path", "mlt"), default="mlt")
    parser.add_argument("--gigabits", type=float, default=10.0)
    arguments = parser.parse_args()
    width, height = map(int, arguments.pixels.split("x"))
    each = 48 + 24 * arguments.layers
    if arguments.integrator == "mlt":
        each += 32
    film, network = float(width * height * each), arguments.gigabits * 1e9 / 8
    costs = measured_costs()
    print(
        f"a task costs {costs.seconds * 1e3:.2f} ms of client and scheduler and "
        f"{costs.bytes / 1e3:.1f} kB; a film has {film / 1e9:.1f} GB"
    )
    print("| workers | hours | of ideal speed | tasks/s | control busy | messages | last sum |")
    print("|---|---|---|---|---|---|---|")
    work = arguments.hours * 3600
    for workers in WORKERS:
        made = simulate(workers, work, film, network, costs)
        print(
            f"| {workers} | {made.seconds / 3600:.2f} | {made.ideal / made.seconds:.0%} "
            f"| {made.tasks / made.seconds:.1f} | {made.busy / made.seconds:.1%} "
            f"| {made.tasks * costs.bytes / made.seconds / 1e3:.1f} kB/s "
            f"| {tree(workers, film, network):.0f} s |"
        )


if __name__ == "__main__":
    main()
