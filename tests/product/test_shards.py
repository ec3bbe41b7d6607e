"""One shard: the same bytes every time, in WebDataset's order, and no damage goes unnoticed."""

from __future__ import annotations

import errno
import hashlib
import io
import json
import os
import tarfile
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from support.drawn_pairs import DrawnRenderer
from support.folders import names, snapshot
from support.refused import refused

from anyprobe.errors import OutputError
from anyprobe.learning.dataset import shards
from anyprobe.learning.dataset.pair import render_map_pair, render_pair
from anyprobe.learning.dataset.recipe import Recipe
from anyprobe.learning.dataset.render_job import SETTINGS
from anyprobe.learning.dataset.samples import (
    NORMALS,
    SAMPLE_ARRAYS,
    Sample,
    StoreRenderer,
    decode_normals,
    decode_part,
    encode_normals,
)

KINDS = ("object", "map")


def drawn(kind: str, count: int = 5) -> list[Sample]:
    renderer = DrawnRenderer({**SETTINGS, "kind": kind, "procedural_maps": 3}, None)
    return [renderer.sample(renderer.recipe(index)) for index in range(count)]


@pytest.fixture(params=KINDS)
def kind(request) -> str:
    return request.param


@pytest.fixture
def folder(tmp_path):
    """Holds shard 0 of five objects."""
    shards.write_shard(tmp_path / "set", 0, drawn("object"))
    return tmp_path / "set"


# What lies in it


def test_webdataset_finds_every_sample(tmp_path, kind):
    """By its convention: the key ends at the first dot of the name, parts of a key stand together."""
    samples = drawn(kind)
    shards.write_shard(tmp_path, 0, samples)
    path = tmp_path / "shard-000000.tar"
    with tarfile.open(path) as tar:
        members = [(member.name.split(".", 1), tar.extractfile(member).read()) for member in tar]
    found: list[tuple[str, dict[str, bytes]]] = []
    for (key, name), data in members:
        if not found or found[-1][0] != key:
            found.append((key, {}))
        found[-1][1][name] = data
    assert found == [(one.key, one.parts) for one in samples]
    assert list(shards.read_samples(path)) == found


@pytest.mark.filterwarnings("ignore")  # it leaves files to the garbage collector
def test_the_package_webdataset_reads_it(tmp_path, kind):
    webdataset = pytest.importorskip("webdataset", reason="the package webdataset is not installed")
    samples = drawn(kind)
    shards.write_shard(tmp_path, 0, samples)
    read = list(webdataset.WebDataset(str(tmp_path / "shard-000000.tar"), shardshuffle=False))
    assert [one["__key__"] for one in read] == [one.key for one in samples]
    for one, sample in zip(read, samples, strict=True):
        assert {name: one[name] for name in sample.parts} == sample.parts


@pytest.mark.ci
def test_rendered_pairs_come_back_as_they_were():
    """Photo and targets of the true renderer, bit for bit; the rest as told in json."""
    for kind, parts in (("object", ("photo", "irradiance", "normals")), ("map", ("ldr", "ln_radiance"))):
        settings = {**SETTINGS, "kind": kind, "procedural_maps": 1, "procedural_shapes": 1}
        renderer = StoreRenderer(settings, None)
        recipe = renderer.recipe(1)
        pair = (render_pair if kind == "object" else render_map_pair)(recipe, renderer.store)
        sample = renderer.sample(recipe)
        assert list(sample.parts) == [*SAMPLE_ARRAYS[kind], "json"]
        assert sample.key == recipe.key
        for name, (shape, dtype) in SAMPLE_ARRAYS[kind].items():
            array, truth = decode_part(name, sample.parts[name]), getattr(pair, name.split(".")[0])
            assert name.split(".")[0] in parts
            assert (array.shape, str(array.dtype)) == (shape, dtype)
            if name == NORMALS:
                array, truth = decode_normals(array), decode_normals(encode_normals(truth))
            assert np.array_equal(array, truth)
        given = json.loads(sample.parts["json"])
        assert Recipe.from_hex(given["recipe"]) == recipe
        assert np.array_equal(given["map_from_camera"], pair.map_from_camera)
        assert np.array_equal(np.float32(given["gain"]), pair.gain)
        assert (given["map"], given["indoor"]) == (pair.map_name, pair.indoor)
        assert sample.groups[-1] == ("indoor" if pair.indoor else "outdoor")
        if kind == "object":
            assert given["specular"] == (given["alpha"] < 0.5) == (sample.groups[0] == "specular")
            assert np.array_equal(np.float32(given["f0"]), pair.material.f0)
            assert np.array_equal(np.float32(given["albedo"]), pair.material.albedo)
            assert given["tan_half"] == pair.tan_half
            assert given["shape"] == pair.shape_name


def test_index_points_at_every_part(tmp_path, kind):
    samples = drawn(kind)
    index = shards.write_shard(tmp_path, 3, samples)
    data = (tmp_path / "shard-000003.tar").read_bytes()
    assert shards.read_index(tmp_path, 3) == index
    assert (index.size, index.sha256) == (len(data), hashlib.sha256(data).hexdigest())
    for sample in samples:
        places = index.parts[sample.key]
        assert {name: data[start : start + size] for name, (start, size) in places.items()} == sample.parts
    counted = [group for sample in samples for group in sample.groups]
    assert index.groups == {group: counted.count(group) for group in counted}


def test_same_samples_same_bytes(tmp_path, kind, monkeypatch):
    """Whatever the clock, the user's name, the mask of permissions and the folder."""
    shards.write_shard(tmp_path / "a", 0, drawn(kind))
    monkeypatch.setattr("time.time", lambda: 2e9)
    monkeypatch.setenv("USER", "another")
    old = os.umask(0o077)
    try:
        shards.write_shard(tmp_path / "b", 0, drawn(kind))
        shards.write_shard(tmp_path / "b", 0, drawn(kind))
    finally:
        os.umask(old)
    assert snapshot(tmp_path / "a") == snapshot(tmp_path / "b")
    with tarfile.open(tmp_path / "a" / "shard-000000.tar") as tar:
        given = {(m.mtime, m.uid, m.gid, m.uname, m.gname, m.mode) for m in tar}
    assert given == {(0, 0, 0, "", "", 0o644)}


def test_keys_that_webdataset_would_mix_up_are_refused(tmp_path):
    one, two = drawn("object", 2)
    for bad in ([one, two, one], [replace(one, key="a.b")]):
        with pytest.raises(ValueError, match="expected keys without dots, each once"):
            shards.write_shard(tmp_path, 0, bad)
        assert names(tmp_path) == set()


# Whole or not there


def test_interrupted_rewrite_is_not_taken_for_done(folder):
    """The old index goes first: while a shard is made again nothing says that it is there."""
    assert shards.is_done(folder, 0)

    def samples():
        yield drawn("object", 1)[0]
        assert not shards.is_done(folder, 0)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        shards.write_shard(folder, 0, samples())
    assert not shards.is_done(folder, 0)
    assert names(folder) == {"shard-000000.tar"}


def test_index_is_written_after_the_tar_is_on_disk(tmp_path, monkeypatch):
    """Each file is synced before it gets its name, the tar before the index."""
    done = []
    fsync, rename = os.fsync, os.replace
    monkeypatch.setattr(os, "fsync", lambda fd: (done.append("sync"), fsync(fd)))
    monkeypatch.setattr(os, "replace", lambda a, b: (done.append(os.path.basename(b)), rename(a, b)))
    shards.write_shard(tmp_path, 0, drawn("object"))
    assert done == ["sync", "shard-000000.tar", "sync", "shard-000000.json", "sync"]


@pytest.mark.parametrize("nth", [1, 2])
def test_full_disk_leaves_no_shard(folder, monkeypatch, nth):
    """At the tar's or the index's end."""
    calls = []

    def full(descriptor):
        calls.append(descriptor)
        if len(calls) == nth:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OutputError, match="No space left on device") as raised:
        shards.write_shard(folder, 0, drawn("object"))
    assert len(str(raised.value).splitlines()) == 1
    assert not shards.is_done(folder, 0)
    assert names(folder) == {"shard-000000.tar"}


def test_only_temporaries_are_removed(folder):
    ours = {".shard-000001-0123abcd.tar", ".shard-000001-0123abcd.json", ".dataset-00000000.json"}
    others = {".shard-000001.tar", "notes.txt", ".nfs0001", "shard-000007.tar", ".shard-1-xyz.tar.bak"}
    for name in ours | others:
        (folder / name).write_bytes(b"x")
    shards.remove_temporaries(folder)
    assert names(folder) == {"shard-000000.tar", "shard-000000.json"} | others


# Damage


def test_good_shard_has_no_fault(tmp_path, kind):
    shards.write_shard(tmp_path, 0, drawn(kind))
    assert shards.fault(tmp_path, 0, kind, 5) == ""


@pytest.mark.parametrize("where", [0.0, 0.1, 0.5, 0.9, 1.0])
def test_flipped_bit_is_found(folder, where):
    path = folder / "shard-000000.tar"
    data = bytearray(path.read_bytes())
    data[int(where * (len(data) - 1))] ^= 4
    path.write_bytes(data)
    assert shards.is_done(folder, 0)  # its size is right; only reading it shows
    assert "SHA-256" in shards.fault(folder, 0, "object", 5)


@pytest.mark.parametrize("change", [lambda data: data[:-512], lambda data: data + bytes(512), lambda data: b""])
def test_other_size_is_found_and_not_done(folder, change):
    path = folder / "shard-000000.tar"
    path.write_bytes(change(path.read_bytes()))
    assert "bytes, got" in shards.fault(folder, 0, "object", 5)
    assert not shards.is_done(folder, 0)


def test_absent_files_are_found(folder):
    (folder / "shard-000000.tar").rename(folder / "away")
    assert shards.fault(folder, 0, "object", 5) == "shard-000000.tar is missing"
    assert not shards.is_done(folder, 0)
    (folder / "away").rename(folder / "shard-000000.tar")
    (folder / "shard-000000.json").unlink()
    assert "found none" in shards.fault(folder, 0, "object", 5)
    assert not shards.is_done(folder, 0)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('"format": 2', '"format": 9'),
        ('"shard": 0', '"shard": 1'),
        ('{"format"', '["format"'),
        ('"pairs": {', '"pairs": 3, "x": {'),
        ('"photo.png": [512, ', '"photo.png": [513, '),
        ('"photo.png": [512, ', '"photo.png": ["a", '),
        ('"photo.png": [', '"picture.png": ['),
    ],
)
def test_damaged_index_is_found(folder, old, new):
    path = folder / "shard-000000.json"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    assert "index" in shards.fault(folder, 0, "object", 5) or "format" in shards.fault(folder, 0, "object", 5)


def npy(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


def png(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(array).save(stream, "PNG")
    return stream.getvalue()


FULL = np.zeros((64, 128, 3), np.float16)


@pytest.mark.parametrize(
    ("kind", "part", "data", "complaint"),
    [
        ("object", "photo.png", png(np.zeros((128, 128, 3), np.uint8)), "got [128, 128, 3]"),
        ("object", "irradiance.png", png(np.zeros((64, 128, 3), np.uint8)), "got [64, 128, 3]"),
        ("object", "photo.png", b"\x89PNG\r\n\x1a\n cut", "expected a readable file"),
        ("object", "depth.png", b"", "expected photo.png, irradiance.png, normals.png, json, got"),
        ("object", "json", b'{"recipe": 3}', "hexadecimal digits"),
        ("object", "json", drawn("object", 2)[1].parts["json"], "expected this pair's recipe"),
        ("object", "json", b"[]", "expected this pair's recipe"),
        ("map", "ln_radiance.npy", npy(FULL.astype(np.float32)), "got [64, 128, 3] float32"),
        ("map", "ln_radiance.npy", npy(FULL * np.nan), "expected finite numbers"),
        ("map", "ln_radiance.npy", npy(FULL)[:500], "expected a readable file"),
    ],
)
def test_bad_part_is_found_though_its_sum_is_right(tmp_path, kind, part, data, complaint):
    """A shard written whole by someone who packed the wrong thing."""
    samples = drawn(kind)
    samples[0] = replace(samples[0], parts={**samples[0].parts, part: data})
    shards.write_shard(tmp_path, 0, samples)
    wrong = shards.fault(tmp_path, 0, kind, 5)
    assert complaint in wrong
    assert "\n" not in wrong


def test_lost_pair_is_found(folder):
    shards.write_shard(folder, 0, drawn("object")[:-1])
    assert shards.fault(folder, 0, "object", 5) == "expected 5 pairs, got 4"


def test_parts_apart_are_refused(tmp_path):
    one, two = drawn("object", 2)
    path = tmp_path / "apart.tar"
    with tarfile.open(path, "w") as tar:
        for key, name in ((one.key, "a"), (two.key, "a"), (one.key, "b")):
            tar.addfile(tarfile.TarInfo(f"{key}.{name}"))
    with refused(source="apart.tar", naming="together"):
        list(shards.read_samples(path))


def test_normals_are_kept_within_half_a_degree(rng):
    normals = rng.normal(size=(8, 8, 3)).astype(np.float32)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    normals[0] = 0
    back = decode_normals(encode_normals(normals))
    assert not back[0].any()
    cosine = (back * normals).sum(-1)[1:] / np.linalg.norm(back[1:], axis=-1)
    assert np.degrees(np.arccos(np.clip(cosine, -1, 1))).max() < 0.5
