"""A file is known by its size and by parts of it, spread evenly."""

from __future__ import annotations

import pytest

from anyprobe.video.track import BLOCK_BYTES, BLOCKS, sampled_digest


@pytest.mark.parametrize("size", [1, BLOCK_BYTES + 1, BLOCKS * BLOCK_BYTES])
def test_every_byte_of_a_small_file_counts(tmp_path, size):
    path, seen = tmp_path / "clip", set()
    for at in (0, size // 3, size - 1):
        data = bytearray(size)
        data[at] = 1
        path.write_bytes(data)
        seen.add(sampled_digest(path))
    assert len(seen) == len({0, size // 3, size - 1})


def test_a_large_file_is_known_by_its_size_its_ends_and_what_lies_between(tmp_path):
    path, seen = tmp_path / "clip", set()
    size = 1 << 31  # sparse: nothing is stored
    for length, at in ((size, None), (size + 1, None), (size, 0), (size, size - 1), (size, size // 63 + 9)):
        with path.open("wb") as stream:
            stream.truncate(length)
            if at is not None:
                stream.seek(at)
                stream.write(b"x")
        seen.add(sampled_digest(path))
    assert len(seen) == 5
