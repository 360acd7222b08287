"""A scheduler of Dask and workers, in processes of their own that tests kill and pause."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

import usdmlt

if TYPE_CHECKING:
    from distributed import Client

if find_spec("distributed") is None:
    collect_ignore_glob = ["test_*cluster.py", "test_tls.py", "test_workers_memory.py"]

SCENES = Path(__file__).parents[2] / "scenes"


class Cluster:
    """``workers``: processes by name, in the order in which they were started. ``tls``: flags that
    name the certificates of all."""

    def __init__(self, folder: Path, tls: Sequence[str] = ()) -> None:
        self.folder = folder
        self.tls = tls
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = str(free.getsockname()[1])
        protocol = "tls" if tls else "tcp"
        self.address = f"{protocol}://127.0.0.1:{port}"
        arguments = ["scheduler", "--host", "127.0.0.1", "--port", port, "--no-dashboard"]
        self.scheduler = self._start([*arguments, "--protocol", protocol, *tls])
        self.workers: dict[str, subprocess.Popen[bytes]] = {}

    def _start(self, arguments: list[str], path: Path | None = None) -> subprocess.Popen[bytes]:
        environment = dict(os.environ)
        if path is not None:
            environment["PYTHONPATH"] = f"{path}{os.pathsep}{environment.get('PYTHONPATH', '')}"
        return subprocess.Popen(
            [sys.executable, "-m", "dask", *arguments],
            cwd=self.folder,
            env=environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )

    def add(
        self,
        name: str,
        threads: int = 1,
        path: Path | None = None,
        memory: str = "auto",
        nanny: bool = False,
    ) -> None:
        """Start a worker. ``path``: that modules are looked for in first; ``memory``: that it may
        have, in Dask's words; ``nanny``: whether it is started again when it is killed, and killed
        when it has more."""
        arguments = ["worker", self.address, "--host", "127.0.0.1", "--no-dashboard"]
        arguments += ["--memory-limit", memory, "--nanny" if nanny else "--no-nanny"]
        arguments += ["--nthreads", str(threads), "--name", name, *self.tls]
        self.workers[name] = self._start(arguments, path)

    def kill(self, name: str) -> None:
        self.workers[name].kill()
        self.workers[name].wait()

    def pause(self, name: str) -> None:
        self.workers[name].send_signal(signal.SIGSTOP)

    def go_on(self, name: str) -> None:
        self.workers[name].send_signal(signal.SIGCONT)

    def stop(self) -> None:
        for process in (*self.workers.values(), self.scheduler):
            process.kill()
            process.wait()

    @contextlib.contextmanager
    def client(self, workers: int, **options: Any) -> Iterator[Client]:
        from distributed import Client

        with Client(self.address, timeout=30, set_as_default=False, **options) as client:
            if workers:
                client.wait_for_workers(workers, timeout=60)
            yield client


@pytest.fixture(scope="session")
def start_cluster() -> type[Cluster]:
    """Starts a scheduler in a folder, which the test stops."""
    return Cluster


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    """A scheduler without workers."""
    made = Cluster(tmp_path)
    yield made
    made.stop()


@pytest.fixture
def scene() -> usdmlt.Scene:
    return usdmlt.load(SCENES / "cornell_box.usda", width=64)


@pytest.fixture
def plan(scene) -> Callable[..., usdmlt.Rendering]:
    """Renderings of one plan: light of several bounces, by chains unless told otherwise."""

    def make(**settings: object) -> usdmlt.Rendering:
        settings = {"integrator": "mlt", "samples": 3000, "aovs": "direct,sampleCount"} | settings
        return usdmlt.Rendering(scene, usdmlt.Settings(**settings))

    return make
