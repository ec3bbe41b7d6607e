"""anyprobe_train.assets polyhaven, against a local imitation of the site: what lies in the folder, and manners."""

from __future__ import annotations

import csv
import hashlib
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from support.folders import names, snapshot
from support.polyhaven_server import Fault, PolyHaven, tetrahedron

from anyprobe import __version__
from anyprobe.cli.app import main
from anyprobe.files.objects import read_mesh
from anyprobe.maps.radiance import write_exr, write_hdr
from anyprobe_train.assets import download
from anyprobe_train.assets.polyhaven import LICENCE, family, split_of
from anyprobe_train.cli.data import app
from anyprobe_train.dataset.catalog import allows_commercial_use, load_maps, load_shapes

SMALL = {"hdr": "/file/HDRIs/hdr/1k/{}_1k.hdr", "exr": "/file/HDRIs/exr/1k/{}_1k.exr"}
ROOF = SMALL["hdr"].format("roof")


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr(download, "BACKOFF_S", 0.01)
    monkeypatch.setenv("no_proxy", "127.0.0.1")


@pytest.fixture(scope="module")
def bodies(tmp_path_factory):
    """Files of six maps, no two alike: each map's by resolution and format."""
    folder, noise = tmp_path_factory.mktemp("bodies"), np.random.default_rng(7)

    def made() -> dict[str, bytes]:
        found = {}
        radiance = noise.gamma(1.0, 2.0, (64, 128, 3)).astype(np.float32)
        for resolution, rows in (("1k", 32), ("2k", 64)):
            for suffix, write in (("hdr", write_hdr), ("exr", write_exr)):
                write(folder / f"source.{suffix}", radiance[:rows, : 2 * rows])
                found[f"{resolution}/{suffix}"] = (folder / f"source.{suffix}").read_bytes()
        return found

    return [made() for _ in range(6)]


@pytest.fixture
def site(bodies):
    """Six maps and one model."""
    site = PolyHaven()
    maps = {
        "old_hall": {"categories": ["indoor", "urban"], "tags": ["hall"]},
        "new_room": {"attributes": {"environment": "indoor"}, "category": "Interiors/Rooms"},
        "white_studio_01": {"categories": ["indoor", "studio"], "attributes": {"environment": "indoor"}},
        "beach": {"categories": ["outdoor", "night"], "category": "Coast & Water/Beaches"},
        "roof": {"categories": ["outdoor", "skies"]},
        "meadow": {"categories": ["outdoor"], "authors": {"Ada Light": "Photo", "Bo Dark": "Sky"}},
    }
    for (slug, entry), files in zip(maps.items(), bodies, strict=True):
        site.add_map(slug, files, **entry)
    document, buffers = tetrahedron()
    site.add_model("ArmChair_01", document, buffers, category="Seating/Chairs", categories=["props"])
    yield site
    site.close()


@dataclass
class Fetcher:
    """The command with the site's address and without pauses."""

    command: object
    site: PolyHaven
    to: Path

    def __call__(self, *arguments, pause=0):
        self.site.requests.clear()
        given = ("polyhaven", "--api", self.site.url, "--pause", pause, "--to", self.to)
        return self.command(*given, *arguments, main=partial(main, app))

    def rows(self, folder="hdri") -> dict[str, dict[str, str]]:
        with (self.to / folder / "manifest.csv").open(newline="", encoding="utf-8") as stream:
            return {row["slug"]: row for row in csv.DictReader(stream)}


@pytest.fixture
def fetch(command, site, tmp_path):
    return Fetcher(command, site, tmp_path / "data")


def files(fetch) -> set[str]:
    return {name for name in names(fetch.to) if Path(name).suffix}


# What lies in the folder


def test_fills_the_folder_that_training_reads(fetch, site):
    outcome = fetch("--split", 0)
    assert outcome.status == 0, outcome.err
    slugs = {"old_hall", "new_room", "white_studio_01", "beach", "roof", "meadow"}
    maps = load_maps(fetch.to / "hdri" / "train", commercial_only=True)
    assert {one.name for one in maps} == slugs
    assert {one.name for one in maps if one.indoor} == {"old_hall", "new_room", "white_studio_01"}
    shapes = load_shapes(fetch.to / "meshes" / "train", commercial_only=True)
    assert [one.name for one in shapes] == ["ArmChair_01"]
    expected = {f"hdri/train/{slug}.hdr" for slug in slugs} | {"meshes/train/ArmChair_01.glb"}
    assert files(fetch) == expected | {"hdri/manifest.csv", "meshes/manifest.csv"}
    body = site.bodies[SMALL["hdr"].format("beach")]
    assert (fetch.to / "hdri/train/beach.hdr").read_bytes() == body
    assert "Powered by Poly Haven" in outcome.err


def test_manifest_says_whose_each_file_is(fetch, site):
    fetch("--split", 0)
    rows = fetch.rows() | fetch.rows("meshes")
    assert {row["licence"] for row in rows.values()} == {"CC0-1.0 (Poly Haven)"}
    for slug, row in rows.items():
        folder = fetch.to / ("meshes" if slug == "ArmChair_01" else "hdri")
        assert hashlib.md5((folder / row["file"]).read_bytes()).hexdigest() == row["md5"]
        assert row["source"] == f"https://polyhaven.com/a/{slug}"
        assert row["split"] == "train"
    assert rows["meadow"]["authors"] == "Ada Light, Bo Dark"
    assert rows["meadow"]["url"] == site.url + SMALL["hdr"].format("meadow")
    categories = {slug: rows[slug]["category"] for slug in ("old_hall", "new_room", "white_studio_01", "roof")}
    assert list(categories.values()) == ["indoor", "indoor", "studio", "outdoor"]
    assert rows["ArmChair_01"]["category"] == "Seating/Chairs"
    assert allows_commercial_use(LICENCE)


def test_model_keeps_its_triangles_and_needs_no_other_file(fetch, site):
    assert fetch("--type", "models", "--split", 0).status == 0
    mesh = read_mesh(fetch.to / "meshes/train/ArmChair_01.glb")
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 1]])  # the node is twice as high
    middle = np.array([0.5, 1, 0.5])
    expected = (corners - middle) / np.linalg.norm(corners - middle, axis=1).max()
    np.testing.assert_allclose(mesh.positions[np.lexsort(mesh.positions.T)], expected[np.lexsort(expected.T)])
    volume = np.linalg.det(mesh.positions[mesh.faces].astype(float)).sum()
    assert volume > 0  # still counter-clockwise from outside
    assert site.paths("/file/") == ["/file/gltf/1k/ArmChair_01_1k.gltf", "/file/gltf/8k/ArmChair_01/my shape.bin"]
    packed = (fetch.to / "meshes/train/ArmChair_01.glb").read_bytes()
    assert b"NORMAL" not in packed
    assert b"textures" not in packed


def test_rows_and_files_of_others_stay(fetch, site):
    own = fetch.to / "hdri" / "train"
    own.mkdir(parents=True)
    (own / "beach.hdr").write_bytes(b"mine")
    (fetch.to / "hdri" / "manifest.csv").write_text("file,licence,lens\ntrain/roof.exr,own,8mm\n")
    outcome = fetch("--type", "hdris", "--split", 0)
    assert outcome.status == 0
    assert (own / "beach.hdr").read_bytes() == b"mine"
    assert not (own / "roof.hdr").exists()  # it is there, in another format
    text = (fetch.to / "hdri" / "manifest.csv").read_text().splitlines()
    assert text[0].startswith("file,licence,lens,slug")
    assert text[1].startswith("train/roof.exr,own,8mm")
    assert len(text) == 2 + 4


# What is chosen


def test_dry_run_lists_and_fetches_nothing(fetch, site):
    outcome = fetch("--dry-run", "--category", "outdoor", "--category", "Night")
    assert outcome.status == 0
    assert "beach" in outcome.out
    assert "meadow" not in outcome.out
    assert "ArmChair_01" not in outcome.out
    assert site.paths() == ["/assets?type=hdris", "/assets?type=models"]
    assert not fetch.to.exists()


@pytest.mark.parametrize("category", ["Coast & Water", "beaches", "coast & water/beaches", "NIGHT"])
def test_old_and_new_categories_both_filter(fetch, category):
    assert fetch("--split", 0, "--category", category).status == 0
    assert set(fetch.rows()) == {"beach"}


def test_split_is_a_function_of_the_slug_that_only_grows():
    slugs = [f"place{index}x" for index in range(2000)]
    held = {share: {slug for slug in slugs if split_of(slug, share) == "test"} for share in (0, 0.1, 0.3, 1)}
    assert held[0] == set()
    assert held[1] == set(slugs)
    assert held[0.1] < held[0.3]
    assert 0.08 < len(held[0.1]) / len(slugs) < 0.12
    # for ever: another hash would put what old runs held out into training
    slugs = ["beach", "cave_wall", "meadow", "old_hall", "roof", "rural_road", "studio_small_01", "venice_sunset"]
    assert [slug for slug in slugs if split_of(slug, 0.1) == "test"] == ["beach", "meadow", "rural_road"]


def test_near_twins_fall_on_the_same_side():
    assert family("venice_sunset_puresky") == family("venice_sunset") == "venice_sunset"
    assert family("studio_small_01") == family("studio_small_09") == "studio_small"
    assert family("kloofendal_48d_partly_cloudy") == "kloofendal_48d_partly_cloudy"
    assert family("_01") == "_01"
    for name in map("place{}x".format, range(50)):
        assert split_of(f"{name}_puresky", 0.5) == split_of(f"{name}_02", 0.5) == split_of(name, 0.5)


# What is not asked for twice


def test_second_run_asks_for_the_list_only(fetch, site):
    fetch("--split", 0)
    before = snapshot(fetch.to)
    outcome = fetch("--split", 0)
    assert outcome.status == 0
    assert site.paths() == ["/assets?type=hdris", "/assets?type=models"]
    assert snapshot(fetch.to) == before


# Trouble on the way


@pytest.mark.parametrize(
    "fault",
    [
        Fault(status=500),
        Fault(status=503, headers={"Retry-After": "0"}),
        Fault(end_after=1000),
        Fault(end_after=0),
        Fault(body=b"x" * 7000),
    ],
    ids=["500", "503", "truncated", "nothing", "garbage of another length"],
)
def test_one_fault_is_survived(fetch, site, fault):
    site.faults[ROOF] = [fault]
    outcome = fetch("--split", 0, "--category", "skies")
    assert outcome.status == 0, outcome.err
    assert (fetch.to / "hdri/train/roof.hdr").read_bytes() == site.bodies[ROOF]
    assert site.paths("/file/") == [ROOF] * 2


def test_server_that_wants_an_hour_is_left_alone(fetch, site):
    site.faults["/files/beach"] = [Fault(status=429, headers={"Retry-After": "3600"})] * 9
    outcome = fetch("--type", "hdris", "--split", 0)
    assert outcome.status == 2
    assert site.paths()[-1] == "/files/beach"
    assert "asks to wait 3600 s" in outcome.err
    assert "not tried" in outcome.err
    site.faults.clear()
    assert fetch("--type", "hdris", "--split", 0).status == 0
    assert len(fetch.rows()) == 6


def test_others_go_on_when_some_fail(fetch, site):
    site.faults["/files/beach"] = [Fault(status=404)]  # no second try
    site.faults["/files/meadow"] = [Fault(body=b"<html>log in</html>")]
    site.faults["/files/old_hall"] = [Fault(status=502)] * download.ATTEMPTS
    site.files["roof"]["hdri"]["1k"]["hdr"]["md5"] = "0" * 32
    site.files["new_room"] = {"hdri": {"1k": {"hdr": {"url": "file:///etc/hosts", "md5": "0" * 32, "size": 9}}}}
    outcome = fetch("--type", "hdris", "--split", 0)
    assert outcome.status == 2
    complaints = [line for line in outcome.err.splitlines() if line.startswith("anyprobe: ")]
    assert len(complaints) == 5
    for slug, text in {
        "beach": "HTTP 404",
        "meadow": "expected a JSON object, got '<html>log in</html>'",
        "old_hall": "HTTP 502 Bad Gateway, 5 times in a row",
        "roof": f"expected MD5 {'0' * 32}, got ",
        "new_room": "expected a http or https address",
    }.items():
        assert any(line.startswith(f"anyprobe: {slug}: ") and text in line for line in complaints), slug
    assert site.paths("/files/old_hall") == ["/files/old_hall"] * download.ATTEMPTS
    assert site.paths(ROOF) == [ROOF] * 2  # a wrong MD5 is not asked for for ever
    assert files(fetch) == {"hdri/manifest.csv", "hdri/train/white_studio_01.hdr"}


def test_map_that_training_would_refuse_is_not_kept(fetch, site):
    site.add_map("roof", {"1k/hdr": b"#?RADIANCE\nbroken"}, categories=["skies"])
    outcome = fetch("--category", "skies", "--split", 0)
    assert outcome.status == 2
    assert "roof: as published, but roof.hdr: " in outcome.err
    assert files(fetch) == set()


@pytest.mark.parametrize("slug", ["../../evil", "a/b", "x.hdr", ""])
def test_slug_that_is_no_name_is_refused(fetch, site, slug):
    site.assets["hdris"][slug] = {}
    assert fetch("--type", "hdris").status == 2
    assert not fetch.to.exists()


# Manners


def test_one_request_at_a_time_with_a_pause_and_a_name(fetch, site):
    fetch("--type", "hdris", "--limit", 2, "--split", 0, pause=0.15)
    began = [one.began for one in site.requests]
    assert len(began) == 5  # the list, then for each map its files and one file
    assert np.diff(began).min() > 0.14
    assert site.most_at_once == 1
    assert all(one.headers["User-Agent"].startswith(f"anyprobe/{__version__} ") for one in site.requests)
