"""Pictures on tev's display: packets that a server of our own takes apart, byte by byte."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import usdmlt
from usdmlt import Error, Image, previews, read_image
from usdmlt.cli import main
from usdmlt.display import Display, address

SCENE = Path(__file__).parents[2] / "scenes" / "cornell_box.usda"


class Packet:
    """Reads what tev's IStream reads: little-endian numbers, and strings up to a 0."""

    def __init__(self, data: bytes) -> None:
        self.data = data

    def number(self, size: int) -> int:
        taken, self.data = self.data[:size], self.data[size:]
        assert len(taken) == size
        return int.from_bytes(taken, "little", signed=True)

    def text(self) -> str:
        taken, _, self.data = self.data.partition(b"\0")
        return taken.decode()


class Server:
    """Keeps the pictures that it is told of, as tev would show them. ``limit``: bytes after which
    it hangs up."""

    def __init__(self, limit: float = np.inf) -> None:
        self.listening = socket.create_server(("127.0.0.1", 0))
        self.port = self.listening.getsockname()[1]
        self.pictures: dict[str, dict[str, np.ndarray]] = {}
        self.log: list[str] = []
        self.errors: list[BaseException] = []
        self.received = 0
        self.limit = limit
        self.thread = threading.Thread(target=self._serve, daemon=True)
        self.thread.start()

    def _serve(self) -> None:
        try:
            connection, _ = self.listening.accept()
            with connection, connection.makefile("rb") as stream:
                while (head := stream.read(4)) and self.received < self.limit:
                    size = int.from_bytes(head, "little")
                    body = stream.read(size - 4)
                    assert len(body) == size - 4, "a packet was cut"
                    self.received += size
                    self._take(Packet(body))
        except BaseException as error:
            self.errors.append(error)

    def _take(self, packet: Packet) -> None:
        kind = packet.number(1)
        if kind == 2:
            name = packet.text()
            del self.pictures[name]
            self.log.append(f"close {name}")
        elif kind == 4:
            packet.number(1)
            name, width, height = packet.text(), packet.number(4), packet.number(4)
            channels = [packet.text() for _ in range(packet.number(4))]
            self.pictures[name] = {c: np.full((height, width), np.nan, "f4") for c in channels}
            self.log.append(f"create {name}")
        elif kind == 6:
            assert packet.number(1) in (0, 1)
            name = packet.text()
            channels = [packet.text() for _ in range(packet.number(4))]
            x, y, width, height = (packet.number(4) for _ in range(4))
            offsets = [packet.number(8) for _ in channels]
            strides = [packet.number(8) for _ in channels]
            values = np.frombuffer(packet.data, "<f4")
            pixels = width * height
            assert len(values) == max(
                o + (pixels - 1) * s + 1 for o, s in zip(offsets, strides, strict=True)
            )
            for channel, o, s in zip(channels, offsets, strides, strict=True):
                plane = values[o : o + (pixels - 1) * s + 1 : s].reshape(height, width)
                self.pictures[name][channel][y : y + height, x : x + width] = plane
            packet.data = b""
            self.log.append(f"update {name}")
        else:
            raise AssertionError(f"tev knows no packet {kind} of these")
        assert packet.data == b""

    def close(self) -> None:
        self.thread.join(10)
        self.listening.close()
        assert not self.errors, self.errors


@pytest.fixture
def server() -> Iterator[Server]:
    running = Server()
    yield running
    running.close()


def picture(height: int, width: int, **more: np.ndarray) -> Image:
    rng = np.random.default_rng(height)
    image = Image.from_rgba(rng.random((height, width, 4), dtype=np.float32))
    image.channels |= more
    return image


def test_all_layers_are_shown_bit_for_bit(server: Server) -> None:
    """1500 rows of 800 pixels are several packets."""
    rng = np.random.default_rng(1)
    normals = rng.normal(size=(1500, 800, 3)).astype(np.float32)
    numbers = rng.integers(0, 1000, (1500, 800), dtype=np.uint32)
    image = picture(1500, 800, N=normals, objectId=numbers)
    display = Display(f"127.0.0.1:{server.port}")
    display.show("größe.exr", image)
    display.close()
    server.close()
    shown = server.pictures["größe.exr"]
    assert list(shown) == ["R", "G", "B", "A", "N.X", "N.Y", "N.Z", "objectId"]
    assert server.log.count("update größe.exr") > 5
    for c, name in enumerate("RGB"):
        np.testing.assert_array_equal(shown[name], image["color"][..., c])
    np.testing.assert_array_equal(shown["A"], image["alpha"])
    np.testing.assert_array_equal(shown["N.Y"], normals[..., 1])
    np.testing.assert_array_equal(shown["objectId"], numbers.astype(np.float32))


def test_a_picture_is_updated_in_place_and_replaced_when_its_size_changes(server: Server) -> None:
    display = Display(f"localhost:{server.port}")
    for image in (picture(4, 5), picture(4, 5), picture(3, 5)):
        display.show("a", image)
    display.show("b", picture(2, 2))
    display.close()
    server.close()
    expected = "create a,update a,update a,close a,create a,update a,create b,update b"
    assert server.log == expected.split(",")
    np.testing.assert_array_equal(server.pictures["a"]["R"], picture(3, 5)["color"][..., 0])


def test_a_render_is_shown_while_it_goes_on_and_when_it_is_done(
    server: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(previews, "FIRST_SECONDS", 0.0)
    flags = ["-w", "32", "--samples", "3000", "--integrator", "path", "--depth", "4", "-q"]
    output, display = str(tmp_path / "a.exr"), f"127.0.0.1:{server.port}"
    assert main(["render", str(SCENE), output, *flags, "--display", display]) == 0
    server.close()
    assert server.log[0] == "create a.exr" and server.log.count("update a.exr") >= 2
    shown = np.stack([server.pictures["a.exr"][c] for c in "RGB"], axis=-1)
    np.testing.assert_array_equal(shown.astype("f2"), read_image(output)["color"].astype("f2"))


def test_a_display_that_goes_away_is_a_warning_and_the_picture_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(previews, "FIRST_SECONDS", 0.0)
    monkeypatch.setattr("usdmlt.cli.pictures.DISPLAY_SECONDS", 0.01)
    server = Server(limit=40_000)
    flags = ["-w", "48", "--samples", "3000", "--integrator", "path", "--depth", "4"]
    output, display = str(tmp_path / "a.exr"), f"127.0.0.1:{server.port}"
    assert main(["render", str(SCENE), output, *flags, "--display", display]) == 0
    warnings = [line for line in capsys.readouterr().err.splitlines() if "warning" in line]
    assert len(warnings) == 1 and "has gone away" in warnings[0]
    alone = usdmlt.render(SCENE, width=48, samples=3000, integrator="path", depth=4)
    again = read_image(output)["color"]
    np.testing.assert_array_equal(again, alone["color"].astype("f2"))
    server.close()


def test_a_display_that_takes_nothing_in_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("usdmlt.display.TIMEOUT_SECONDS", 0.2)
    with socket.create_server(("127.0.0.1", 0)) as idle:
        display = Display(f"127.0.0.1:{idle.getsockname()[1]}")
        with pytest.raises(Error, match="has gone away: timed out"):
            display.show("a", picture(1500, 1500))
        display.close()


def test_a_port_that_refuses_is_one_line() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
    with pytest.raises(Error, match=f"cannot connect to the display localhost:{port}: ") as caught:
        Display(f"localhost:{port}")
    assert "\n" not in str(caught.value)
    with pytest.raises(Error, match="cannot connect to the display no such host:14158"):
        Display("no such host")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("localhost:14158", ("localhost", 14158)),
        ("render.farm", ("render.farm", 14158)),
        (":99", ("localhost", 99)),
        ("[::1]:7", ("::1", 7)),
        ("::1", ("::1", 14158)),
    ],
)
def test_addresses(text: str, expected: tuple[str, int]) -> None:
    assert address(text) == expected


@pytest.mark.parametrize("text", ["", "a:b", "a:", "a:0", "a:65536", "a:-1"])
def test_addresses_that_are_none(text: str) -> None:
    with pytest.raises(ValueError, match="is not HOST:PORT"):
        address(text)
