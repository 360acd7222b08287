"""Scenes on their way to workers: large arrays go by what they hold, once to each worker.

An array is a task of Dask whose key is its checksum: workers have it from each other, frames that
share it do not send it again, and if all workers that had it are lost the scheduler gives it again.
"""

from __future__ import annotations

import hashlib
import pickle
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from distributed import Client, Future

    from usdmlt.scene import Scene

SMALLEST = 1 << 16  # bytes; below this, arrays go with the scene


class Shipment:
    """What a client has sent; it stays on the workers as long as this is there."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self._sent: dict[str, Future] = {}

    def send(self, scene: Scene) -> list[Future]:
        """The scene as futures, for :func:`unpacked`."""
        large: list[pickle.PickleBuffer] = []

        def keep(buffer: pickle.PickleBuffer) -> bool:
            """Whether it stays with the scene."""
            if buffer.raw().nbytes < SMALLEST:
                return True
            large.append(buffer)
            return False

        packed = pickle.dumps(scene, protocol=5, buffer_callback=keep)
        return [self._sent_once(packed), *(self._sent_once(bytes(b.raw())) for b in large)]

    def _sent_once(self, content: bytes) -> Future:
        import dask
        from toolz import identity

        key = f"usdmlt-{hashlib.sha256(content).hexdigest()}"
        if key not in self._sent:
            with dask.config.set({"distributed.admin.large-graph-warning-threshold": "1 TiB"}):
                self._sent[key] = self._client.submit(identity, content, key=key, priority=20)
        return self._sent[key]


def unpacked(packed: bytes, buffers: list[Any]) -> Scene:
    """The scene, of what the futures hold."""
    scene: Scene = pickle.loads(packed, buffers=buffers)
    return scene
