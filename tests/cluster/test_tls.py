"""Encrypted connections, as docs/long-renders.md has them, with certificates that are made here."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import usdmlt

# Schedulers and workers of their own: minutes, and whatever else the machine does matters.
pytestmark = pytest.mark.slow

SCENE = Path(__file__).parents[2] / "scenes" / "cornell_box.usda"
FLAGS = ["-w", 32, "--integrator", "mlt", "--samples", 32]


def certificate(folder: Path, name: str) -> None:
    """``NAME.pem``, which signs itself and so is its own authority, and its ``NAME.key``."""
    make = "openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -days 2"
    files = ["-subj", f"/CN={name}", "-keyout", f"{name}.key", "-out", f"{name}.pem"]
    subprocess.run([*make.split(), *files], cwd=folder, check=True, capture_output=True)


@pytest.fixture(scope="module")
def keys(tmp_path_factory) -> Path:
    """A folder of two certificates, ``own`` and ``other``."""
    if shutil.which("openssl") is None:
        pytest.skip("there is no openssl to make certificates with")
    folder = tmp_path_factory.mktemp("keys")
    for name in ("own", "other"):
        certificate(folder, name)
    return folder


@pytest.fixture(scope="module")
def secure(keys, start_cluster) -> Iterator[object]:
    """A scheduler and a worker that want the certificate ``own``."""
    tls = ["--tls-ca-file", keys / "own.pem", "--tls-cert", keys / "own.pem"]
    cluster = start_cluster(keys, [*map(str, tls), "--tls-key", str(keys / "own.key")])
    cluster.add("a")
    yield cluster
    cluster.stop()


def configuration(folder: Path, ca_file: str = "own", cert: str = "own", key: str = "own") -> None:
    """As Dask's documentation has it, in a folder that Dask looks for it in."""
    (folder / "dask.yaml").write_text(
        f"""
distributed:
  comm:
    tls:
      ca-file: {ca_file and f"{ca_file}.pem"}
      client:
        cert: {cert}.pem
        key: {key}.key
"""
    )


def render(folder: Path, output: Path, *flags: object) -> subprocess.CompletedProcess[str]:
    """From the command line, by the configuration and certificates of a folder."""
    command = [sys.executable, "-m", "usdmlt", "render", SCENE, output, *FLAGS, *flags]
    return subprocess.run(
        [str(word) for word in command],
        cwd=folder,
        env=os.environ | {"DASK_CONFIG": str(folder)},
        capture_output=True,
        text=True,
        timeout=120,
    )


def test_a_render_from_the_command_line_takes_the_certificates_from_dasks_configuration(
    secure, keys, tmp_path
) -> None:
    configuration(keys)
    there, here = tmp_path / "a.exr", tmp_path / "b.exr"
    done = render(keys, there, "--cluster", secure.address)
    assert done.returncode == 0, done.stderr
    assert render(keys, here).returncode == 0
    first, second = usdmlt.read_image(there), usdmlt.read_image(here)
    for name, pixels in second.channels.items():
        np.testing.assert_array_equal(first[name], pixels, err_msg=name)


def test_in_python_the_client_has_its_own_security(secure, keys, scene) -> None:
    from distributed import Security

    own = {"tls_client_cert": str(keys / "own.pem"), "tls_client_key": str(keys / "own.key")}
    security = Security(tls_ca_file=str(keys / "own.pem"), require_encryption=True, **own)
    with secure.client(1, security=security) as client:
        there = usdmlt.render(scene, integrator="mlt", samples=32, client=client)
    here = usdmlt.render(scene, integrator="mlt", samples=32)
    np.testing.assert_array_equal(there["color"], here["color"])
    np.testing.assert_array_equal(there["error"], here["error"])


@pytest.mark.parametrize(
    ("files", "said"),
    [
        ({"cert": "other", "key": "other"}, "certificates and those here do not match"),
        ({"ca_file": "other"}, "certificates and those here do not match"),
        ({"ca_file": "missing"}, "Dask's certificates (missing.pem, own.pem, own.key) cannot be"),
        ({"key": "other"}, "Dask's certificates (own.pem, own.pem, other.key) cannot be used"),
        ({"ca_file": ""}, "Dask's configuration has no certificates for tls://"),
    ],
)
def test_certificates_that_do_not_fit_are_an_error_of_a_line(
    secure, keys, tmp_path, files, said
) -> None:
    configuration(keys, **files)
    fails_in_a_line(keys, tmp_path, secure.address, said)


def test_addresses_of_the_wrong_kind_are_an_error_of_a_line(secure, keys, tmp_path) -> None:
    configuration(keys)
    plain = secure.address.replace("tls", "tcp")
    fails_in_a_line(keys, tmp_path, plain, f"answers at {plain}: perhaps it is tls://")
    with (keys / "dask.yaml").open("a") as file:
        file.write("    require-encryption: true\n")
    said = f"Dask's configuration requires encryption: {plain} is not tls://"
    fails_in_a_line(keys, tmp_path, plain, said)


def test_a_scheduler_that_is_not_encrypted_is_no_match_for_tls(cluster, keys, tmp_path) -> None:
    configuration(keys)
    address = cluster.address.replace("tcp", "tls")
    fails_in_a_line(keys, tmp_path, address, f"no scheduler of Dask answers at {address}")


@pytest.mark.parametrize("answer", [b"", b"HTTP/1.1 400 Bad Request\r\n\r\n"])
def test_what_is_no_scheduler_is_not_waited_for(keys, tmp_path, answer) -> None:
    """Something that says nothing, and something that answers as a dashboard does."""
    held = []  # connections, so that they stay open

    def serve() -> None:
        while True:
            try:
                held.append(listener.accept()[0])
            except OSError:
                return
            held[-1].sendall(answer)

    with socket.create_server(("127.0.0.1", 0)) as listener:
        threading.Thread(target=serve, daemon=True).start()
        address = f"tcp://127.0.0.1:{listener.getsockname()[1]}"
        fails_in_a_line(tmp_path, tmp_path, address, f"no scheduler of Dask answers at {address}")
        listener.shutdown(socket.SHUT_RDWR)


def fails_in_a_line(keys: Path, folder: Path, address: str, said: str) -> None:
    done = render(keys, folder / "a.exr", "--cluster", address)
    assert done.returncode == 1, done.stderr
    assert said in done.stderr
    assert len(done.stderr.splitlines()) == 1, done.stderr
