"""Pictures on the display of tev, the viewer, by its protocol over TCP.

A packet is its length in bytes, itself included (uint32), its type (uint8) and what the type asks
for; integers are little-endian, strings end with a 0 (tev's Ipc.h and Ipc.cpp):

    CreateImage (4):   grab focus (uint8), name, width, height, channels (int32), their names
    UpdateImageV3 (6): grab focus, name, channels, their names, x, y, width, height (int32),
                       of each channel the offset and the stride (int64), float32 values
    CloseImage (2):    name
"""

from __future__ import annotations

import contextlib
import os
import re
import socket
import struct
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from usdmlt.errors import Error, UsageError

if TYPE_CHECKING:
    from usdmlt.image import Image

PORT = 14158  # tev's own
TIMEOUT_SECONDS = 5.0
ROWS_BYTES = 4 << 20  # of one packet, about

CLOSE, CREATE, UPDATE = 2, 4, 6


def address(text: str) -> tuple[str, int]:
    """Host and port of ``HOST``, ``HOST:PORT``, ``[::1]:PORT`` or ``:PORT``; else ValueError."""
    match = re.fullmatch(r"(?:\[(?P<v6>[^\]]+)\]|(?P<host>[^:]*)):(?P<port>\d+)", text)
    if match is None and text and (text.count(":") != 1):
        return text.strip("[]"), PORT  # a name alone, or an address of IPv6
    port = int(match["port"]) if match else 0
    if match is None or not 0 < port < 65536:
        raise UsageError(f"{text!r} is not HOST:PORT, such as localhost:{PORT}")
    return match["v6"] or match["host"] or "localhost", port


class Display:
    """A connection to a tev that shows one picture after the other, each updated as it grows.

    Raises :class:`usdmlt.Error` when it cannot connect, and later when it has gone away.
    """

    def __init__(self, text: str) -> None:
        host, port = address(text)
        self.name = f"the display {host}:{port}"
        self._shape: dict[str, tuple[int, int, tuple[str, ...]]] = {}
        try:
            self._socket = socket.create_connection((host, port), timeout=TIMEOUT_SECONDS)
        except OSError as error:
            raise Error(f"cannot connect to {self.name}: {_reason(error)}") from None

    def show(self, title: str, image: Image) -> None:
        """Show the picture under that title, in the place of the last one of the title."""
        channels = _channels(image)
        shape = image.height, image.width, tuple(channels)
        if self._shape.get(title) != shape:
            if title in self._shape:
                self._send(CLOSE, _string(title))
            self._shape[title] = shape
            size = struct.pack("<iii", image.width, image.height, len(channels))
            self._send(CREATE, b"\1", _string(title), size, _strings(channels))
        stacked = np.stack(list(channels.values()), axis=-1).astype("<f4")
        rows = max(ROWS_BYTES // stacked[0].nbytes, 1)
        for y in range(0, image.height, rows):
            self._update(title, channels, y, stacked[y : y + rows])

    def close(self) -> None:
        """Let go of the display, which keeps its pictures."""
        with contextlib.suppress(OSError):
            self._socket.close()

    def _update(
        self,
        title: str,
        names: dict[str, npt.NDArray[np.float32]],
        y: int,
        pixels: npt.NDArray[np.float32],
    ) -> None:
        height, width, count = pixels.shape
        self._send(
            UPDATE,
            b"\0",
            _string(title),
            struct.pack("<i", count),
            _strings(names),
            struct.pack("<iiii", 0, y, width, height),
            struct.pack(f"<{count}q", *range(count)),
            struct.pack(f"<{count}q", *[count] * count),
            pixels.tobytes(),
        )

    def _send(self, kind: int, *contents: bytes) -> None:
        body = b"".join(contents)
        try:
            self._socket.sendall(struct.pack("<IB", len(body) + 5, kind) + body)
        except OSError as error:
            raise Error(f"{self.name} has gone away: {_reason(error)}") from None


def _channels(image: Image) -> dict[str, npt.NDArray[np.float32]]:
    """As an EXR names them. Whole numbers are shown as they are."""
    channels: dict[str, npt.NDArray[np.float32]] = {}
    for name, pixels in image.channels.items():
        columns = pixels[..., None] if pixels.ndim == 2 else pixels
        names = image.layer(name).channels
        for channel, values in zip(names, np.moveaxis(columns, -1, 0), strict=True):
            channels[channel] = np.asarray(values, np.float32)
    return channels


def _string(text: str) -> bytes:
    return os.fsencode(text) + b"\0"


def _strings(texts: dict[str, npt.NDArray[np.float32]]) -> bytes:
    return b"".join(_string(text) for text in texts)


def _reason(error: OSError) -> str:
    return (error.strerror or str(error) or type(error).__name__).rstrip(".")
