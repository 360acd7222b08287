"""Cryptomatte: hashes, metadata, and pairs of ids and coverage."""

from __future__ import annotations

import json

import numpy as np
import pytest

from usdmlt import cryptomatte


@pytest.mark.parametrize(
    ("text", "expected"),
    [("", 0), ("hello", 0x248BFA47), ("The quick brown fox jumps over the lazy dog", 0x2E4FF723)],
)
def test_names_are_hashed_by_murmur3(text, expected):
    """Published values of MurmurHash3_x86_32 with seed 0."""
    assert cryptomatte.murmur3(text) == expected


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("bunny", 0x13851A76),
        ("bush", 0xF763D090),
        ("flowerA.flowerA_petal1.:1015", 0x914754E4),
        ("flowerA.flowerA_petal1.:2230", 0x5142BEFC),
    ],
)
def test_ids_are_those_of_the_specification_s_samples(name, expected):
    """From the manifest of the bunny in Psyop's sample images."""
    assert cryptomatte.identifier(name) == expected


def test_ids_are_ordinary_floats_whatever_the_hash():
    ids = np.array([cryptomatte.identifier(f"/World/mesh_{i}") for i in range(4000)], np.uint32)
    hashes = np.array([cryptomatte.murmur3(f"/World/mesh_{i}") for i in range(4000)], np.uint32)
    exponents = hashes >> 23 & 255
    changed = (exponents == 0) | (exponents == 255)
    assert 0 < np.count_nonzero(changed) < 100
    np.testing.assert_array_equal(ids != hashes, changed)
    assert np.isfinite(ids.view(np.float32)).all()
    assert (np.abs(ids.view(np.float32)) >= np.finfo(np.float32).tiny).all()


def one_pixel(numbers: list[int], coverage: list[float], names: list[str]):
    fill = cryptomatte.RANKS - len(numbers)
    return cryptomatte.layers(
        "CryptoObject",
        np.array([[numbers + [-1] * fill]], np.int32),
        np.array([[coverage + [0.0] * fill]], np.float32),
        lambda seen: [names[i] for i in seen],
    )


def test_pairs_go_into_numbered_layers_the_largest_first():
    names = ["/a", "/b", "/c", "/unseen"]
    pixels, _ = one_pixel([2, 0, 1], [0.5, 0.25, 0.125], names)
    assert list(pixels) == ["CryptoObject00", "CryptoObject01", "CryptoObject02"]
    first, second = pixels["CryptoObject00"][0, 0], pixels["CryptoObject01"][0, 0]
    bits = np.concatenate([first, second])[::2].view(np.uint32)
    assert bits.tolist() == [*map(cryptomatte.identifier, ("/c", "/a", "/b")), 0]
    assert first[1::2].tolist() == [0.5, 0.25] and second[1::2].tolist() == [0.125, 0.0]
    assert not pixels["CryptoObject02"].any()


def test_what_has_the_same_name_is_one():
    pixels, metadata = one_pixel([0, 1, 2], [0.4, 0.35, 0.25], ["/b", "/a", "/a"])
    first = pixels["CryptoObject00"][0, 0]
    assert first[::2].view(np.uint32).tolist() == [*map(cryptomatte.identifier, ("/a", "/b"))]
    np.testing.assert_allclose(first[1::2], [0.6, 0.4], rtol=1e-6)
    assert len(json.loads(metadata["cryptomatte/3ae39a5/manifest"])) == 2


def test_the_metadata_is_the_specification_s():
    """The key is the first seven digits of the layer's own id."""
    _, metadata = one_pixel([0], [1.0], ["/Wörld", "/unseen"])
    key = f"{cryptomatte.identifier('CryptoObject'):08x}"[:7]
    assert metadata == {
        f"cryptomatte/{key}/name": "CryptoObject",
        f"cryptomatte/{key}/hash": "MurmurHash3_32",
        f"cryptomatte/{key}/conversion": "uint32_to_float32",
        f"cryptomatte/{key}/manifest": json.dumps(
            {"/Wörld": f"{cryptomatte.identifier('/Wörld'):08x}"}, ensure_ascii=False
        ),
    }
