"""Maps under names that are no UTF-8, which OpenEXR's own functions do not take."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from support.refused import refused
from support.two_phase import two_phase

from anyprobe.errors import InputError, OutputError
from anyprobe.export.targets import export
from anyprobe.maps.exr import exr_pixels, read_exr
from anyprobe.maps.radiance import map_attributes, write_exr


@pytest.fixture(autouse=True)
def _names_of_any_bytes(tmp_path):
    """The disk takes them; those of Windows and macOS do not."""
    try:
        (tmp_path / os.fsdecode(b"\xe9")).touch()
    except (OSError, UnicodeError) as error:
        pytest.skip(f"the disk takes no such names: {error}")
    (tmp_path / os.fsdecode(b"\xe9")).unlink()


@pytest.mark.parametrize("name", [b"caf\xe9.exr", b"caf\xe9/map.exr", b"caf\xe9/m\xe9.\xe9xr"])
def test_exr_of_a_name_that_is_no_utf8(tmp_path, name):
    path = tmp_path / os.fsdecode(name)
    radiance = two_phase(8).astype(np.float32)
    write_exr(path, radiance, half=False, attributes={"frame": "front"})
    assert [one.name for one in path.parent.iterdir()] == [path.name]
    assert not path.is_symlink()
    assert map_attributes(path) == {"frame": "front"}
    np.testing.assert_array_equal(read_exr(path, "map", InputError, 1000)[..., :3], radiance)
    assert exr_pixels(path.read_bytes()) == 8 * 16
    path.write_bytes(path.read_bytes()[:100])
    with refused(source="map", naming="damaged"):
        read_exr(path, "map", InputError, 1000)


def test_exr_that_cannot_be_written_under_such_a_name_is_one_line(tmp_path, monkeypatch):
    monkeypatch.setattr(Path, "symlink_to", lambda *_: (_ for _ in ()).throw(OSError(1, "no links here")))
    with pytest.raises(OutputError) as caught:
        write_exr(tmp_path / os.fsdecode(b"caf\xe9.exr"), two_phase(4))
    message = str(caught.value)
    assert "\n" not in message
    assert all(word in message for word in ("UTF-8", "no links here", "rename it"))
    assert list(tmp_path.iterdir()) == []


def test_targets_are_written_into_such_a_folder(tmp_path):
    for target in ("mitsuba", "usd"):
        paths = export(two_phase(8), target, tmp_path / os.fsdecode(b"caf\xe9"))
        assert all(path.is_file() and not path.is_symlink() for path in paths)
