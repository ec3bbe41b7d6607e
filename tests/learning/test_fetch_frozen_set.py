"""anyprobe_train.assets test: the frozen test set's files from stand-ins on a local server, and what cannot be had."""

from __future__ import annotations

import csv
import hashlib
import os
from functools import partial
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from support.polyhaven_server import PolyHaven

from anyprobe.cli.app import main
from anyprobe.maps.radiance import write_hdr
from anyprobe_train.assets import download, frozen_set
from anyprobe_train.assets.frozen_set import frozen_files, merged, ply, read_obj, small_map, turned
from anyprobe_train.cli.data import app
from anyprobe_train.dataset.catalog import file_id, load_maps, load_shapes
from anyprobe_train.dataset.recipe import read_recipes
from anyprobe_train.evaluate.scoring import FROZEN

DATA = Path(os.environ.get("ANYPROBE_DATA", Path(__file__).parents[2] / "data"))
OBJ = b"v 0 0 0\nv 2 0 0\nv 0 4 0\nv 0 0 2\nv 2 0 0.00000001\nf 1 3 2\nf 1//1 5//1 4//1\nf 1 4 3\nf 2/1 3/1 4/1\n"
ROOM = np.linspace(0.1, 3.0, 512 * 1024 * 3, dtype=np.float32).reshape(512, 1024, 3)


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr(download, "BACKOFF_S", 0.01)
    monkeypatch.setenv("no_proxy", "127.0.0.1")


@pytest.fixture
def site(tmp_path, monkeypatch):
    """A map and two shapes, of which one cannot be made anew; the table names them and what they become."""
    write_hdr(tmp_path / "room.hdr", ROOM)
    bodies = {"maps/room_1k.hdr": (tmp_path / "room.hdr").read_bytes(), "objects/corner.obj": OBJ}
    site = PolyHaven()
    rows = []
    for file, path, more in (
        ("hdri/test/room.exr", "maps/room_1k.hdr", {"category": "indoor", "licence": "CC0-1.0"}),
        (
            "meshes/test/corner.ply",
            "objects/corner.obj",
            {"licence": "CC BY 4.0; Jane Doe", "axes": "x z -y", "centre": "1 1 -2", "radius": "4"},
        ),
        ("meshes/test/duck.ply", "objects/duck.dae", {"licence": "not stated"}),
    ):
        row = dict.fromkeys("file category licence repository commit path md5 sha256 axes centre radius".split(), "")
        row |= {"file": file, "repository": "doe/things", "commit": "c0ffee", "path": path, **more}
        if path in bodies:
            row["md5"] = hashlib.md5(bodies[path]).hexdigest()
            site.bodies[f"/doe/things/c0ffee/{path}"] = bodies[path]
        rows.append(row)
    rows[0]["sha256"] = hashlib.sha256(exr(tmp_path, small_map(bodies["maps/room_1k.hdr"], "a.hdr"))).hexdigest()
    vertices, faces = merged(*read_obj(OBJ))
    rows[1]["sha256"] = hashlib.sha256(ply((turned(vertices, "x z -y") - [1, 1, -2]) / 4, faces)).hexdigest()
    table = tmp_path / "table.csv"
    with table.open("w", newline="") as stream:
        writer = csv.DictWriter(stream, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    monkeypatch.setattr(frozen_set, "frozen_files", partial(frozen_files, table))
    yield site
    site.close()


def exr(folder: Path, pixels: np.ndarray) -> bytes:
    header = {"compression": OpenEXR.PIZ_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {c: np.ascontiguousarray(pixels[..., i]) for i, c in enumerate("RGB")}).write(
        str(folder / "expected.exr")
    )
    return (folder / "expected.exr").read_bytes()


def fetch(site: PolyHaven, to: Path) -> int:
    """The command's exit status."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sys.argv", ["fetch_assets", "test", str(to), "--pause", "0", "--host", site.url])
        try:
            main(app)
        except SystemExit as end:
            return int(end.code or 0)
    return 0


def test_what_can_be_had_is_made_and_the_rest_named(site, tmp_path, capsys):
    to = tmp_path / "public"
    assert fetch(site, to) == 0
    said = capsys.readouterr().err
    assert "2 fetched, 1 cannot be had" in said
    assert "meshes/test/duck.ply: cannot be had: prepared by software that was not recorded, from doe/things" in said
    (room,) = load_maps(to / "hdri" / "test")
    assert (room.name, room.indoor, room.licence) == ("room", True, "CC0-1.0")
    (corner,) = load_shapes(to / "meshes" / "test")
    assert corner.licence == "CC BY 4.0; Jane Doe"
    for file in frozen_set.frozen_files()[:2]:
        assert file_id(to / file["file"]) == file["sha256"][:8]
    assert not list(to.rglob("*.part"))
    asked = len(site.requests)
    assert fetch(site, to) == 0
    assert "2 complete, 1 cannot be had" in capsys.readouterr().err
    assert len(site.requests) == asked


def test_maps_are_means_and_what_is_no_light_is_black(tmp_path):
    light = np.full((512, 1024, 3), 100000.0, np.float32)
    light[:2, :2] = [[[1, 2, 3]], [[3, 4, 5]]]
    light[2:4, :2], light[4, 0] = np.nan, -1.0
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"RGB": light}).write(str(tmp_path / "a.exr"))
    small = small_map((tmp_path / "a.exr").read_bytes(), "a.exr")
    assert small.shape == (256, 512, 3)
    assert small.dtype == np.float16
    assert small.max() == 50000  # halved until the largest half holds it
    assert small[0, 0].tolist() == [1.0, 1.5, 2.0]
    assert small[1, 0].tolist() == [0, 0, 0]
    assert small[2, 0, 0] == pytest.approx(37500)


def test_the_table_is_that_of_the_frozen_recipes():
    rows = frozen_files()
    named = {row["sha256"][:8] for row in rows}
    assert named == {key for recipe in read_recipes(FROZEN) for key in (recipe.map_id, recipe.shape_id)}
    assert sum(not row["md5"] for row in rows) == 7
    assert all(row["md5"] for row in rows if row["file"].startswith("hdri/"))


@pytest.mark.skipif(not (DATA / "hdri" / "test").is_dir(), reason="needs the test assets")
def test_the_table_has_the_sha256_of_the_files():
    for row in frozen_files():
        assert hashlib.sha256((DATA / row["file"]).read_bytes()).hexdigest() == row["sha256"]
