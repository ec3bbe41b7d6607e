"""The page of assets that weights learned from: what training takes, whose it is, and nothing else."""

from __future__ import annotations

import os
import re
from pathlib import Path

import numpy as np
import pytest
from support.mesh_files import ply
from support.refused import refused

import anyprobe
from anyprobe.maps.radiance import write_hdr
from anyprobe_train.dataset.catalog import file_id
from anyprobe_train.dataset.recipe import Recipe, read_recipes
from anyprobe_train.evaluate.scoring import FROZEN
from research import asset_page as module
from research.asset_page import asset_page, frozen_page, main

ROOT = Path(__file__).parents[2]
SHIPPED = Path(anyprobe.__file__).parent / "weights" / "ASSETS.md"
TEST_ASSETS = ROOT / "docs" / "reference" / "test-assets.md"
DATA = Path(os.environ.get("ANYPROBE_DATA", ROOT / "data"))
CORNERS = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
SIDES = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]

LISTS = """\
## Maps of `hdri/train`: 3

### CC0-1.0

- https://maps.example/a: a.hdr

### CC BY 4.0

- Doe, Roe; some/maps: b.hdr (the room)

### MIT

- A | B; not stated: c.hdr

## Maps of `hdri/train_extra`: 1

### Apache License, Version 2.0

- not stated; https://maps.example/e.hdr: e.hdr

## Shapes of `meshes/train`: 1

### public domain

- Jane Doe; formula: one.ply (tetrahedron)
"""


@pytest.fixture
def data(tmp_path):
    """Three folders with a manifest each: rows in another order than the files, some that training leaves alone."""
    brightness = iter(range(1, 99))

    def light(*names: str) -> None:
        for name in names:
            path = tmp_path / "data" / "hdri" / name
            path.parent.mkdir(parents=True, exist_ok=True)
            picture = np.ones((8, 16, 3), np.float32)
            picture[0] = next(brightness)
            write_hdr(path, picture)

    light("train/b.hdr", "train/a.hdr", "train/c.hdr", "train/unlisted.hdr", "test/t.hdr")
    light("train_extra/e.hdr", "train_extra/sa.hdr")
    maps = tmp_path / "data" / "hdri" / "train"
    (maps / "nc.hdr").write_bytes((maps / "a.hdr").read_bytes())  # the same map, as another gives it away
    (maps / "cut.hdr").write_bytes(b"")
    shapes = tmp_path / "data" / "meshes" / "train"
    shapes.mkdir(parents=True)
    (shapes / "one.ply").write_bytes(ply(CORNERS, SIDES))
    (shapes / "two.ply").write_bytes(ply(2 * CORNERS, SIDES))
    for folder, text in (
        (
            "hdri",
            "file,slug,source,source_repo,source_path,licence,authors,split\n"
            "train/nc.hdr,nc,,some/maps,nc.hdr,CC BY-NC 4.0; Doe,,train\n"
            "train/cut.hdr,cut,,some/maps,cut.hdr,CC0,,train\n"
            "train/c.hdr,,,,,MIT,A | B,train\n"
            'b.hdr,the room,,some/maps,rooms/b.hdr,"CC BY 4.0; Doe, Roe",,train\n'
            "a.hdr,a,https://maps.example/a,,,CC0-1.0,Jane Doe,train\n"
            "t.hdr,t,,,,CC0,,test\n",
        ),
        (
            "hdri/train_extra",
            "file,url,licence\nsa.hdr,,CC BY-SA 4.0; Doe\n"
            'e.hdr,https://maps.example/e.hdr,"Apache License, Version 2.0"\n',
        ),
        (
            "meshes",
            "file,name,source_repo,source_path,licence,split\n"
            "train/two.ply,two,formula,two,no commercial resale,train\n"
            "train/one.ply,tetrahedron,formula,one,public domain (Jane Doe),train\n",
        ),
    ):
        (tmp_path / "data" / folder / "manifest.csv").write_text(text, encoding="utf-8")
    return tmp_path / "data"


@pytest.mark.ci
def test_the_page_lists_what_training_takes_and_nothing_else(work, capsys, data):
    """Neither what may not be sold, nor what nobody lists, nor what cannot be read, nor what is held out."""
    main(data)
    outcome = capsys.readouterr()
    about, lists = outcome.out.split("\n## ", 1)
    assert "## " + lists == LISTS
    assert about.startswith("# Assets that weights learned from\n\nThe 5 files that training uses")
    assert "anyprobe's own" in about
    assert str(data) not in outcome.out
    warnings = outcome.err.splitlines()
    assert len(warnings) == 4
    assert all(line.startswith("warning: ") for line in warnings)
    assert any("cut.hdr" in line for line in warnings)
    main(data, out=Path("out/ASSETS.md"))
    assert capsys.readouterr().out == "out/ASSETS.md\n"
    assert (work / "out" / "ASSETS.md").read_bytes() == outcome.out.encode()


def test_the_shipped_page_is_what_the_command_writes():
    if not (DATA / "hdri" / "train").is_dir():
        pytest.skip(f"the maps and shapes that shipped weights learned from are needed: ANYPROBE_DATA, or {DATA}")
    assert SHIPPED.read_text(encoding="utf-8") == asset_page(DATA, report=lambda line: None)


@pytest.fixture
def frozen(data, monkeypatch) -> list[Recipe]:
    """A frozen set of one recipe, of the held-out map and a shape beside one that it does not name."""
    shapes = data / "meshes" / "test"
    shapes.mkdir()
    for name, scale in (("goat.ply", 3), ("other.ply", 4)):
        (shapes / name).write_bytes(ply(scale * CORNERS, SIDES))
    with (data / "meshes" / "manifest.csv").open("a") as stream:
        stream.write('test/goat.ply,goat,some/meshes,goat.obj,"CC BY-NC 4.0; Doe",test\n')
    ids = {"map_id": file_id(data / "hdri" / "test" / "t.hdr"), "shape_id": file_id(shapes / "goat.ply")}
    recipes = [Recipe(**ids, material=0, view=0, seed=1)]
    monkeypatch.setattr(module, "read_recipes", lambda path: recipes)
    return recipes


def test_the_test_sets_page_lists_what_recipes_name_whatever_its_licence(work, capsys, data, frozen):
    main(data, test=True)
    page = capsys.readouterr().out
    rest = r"[0-9a-f]{56}"
    assert re.search(rf"### CC0\n\n- t.hdr: not stated, `{frozen[0].map_id}{rest}`\n", page)
    goat = r"### CC BY-NC 4.0\n\n- Doe; goat.ply: some/meshes: goat.obj"
    assert re.search(rf"{goat}, `{frozen[0].shape_id}{rest}`\n", page)


def test_a_test_set_that_is_not_whole_has_no_page(data, frozen):
    (data / "meshes" / "test" / "goat.ply").unlink()
    with refused(source="data", naming="1 of 2"):
        frozen_page(data)


def test_the_documented_test_assets_are_those_of_the_frozen_set():
    page = TEST_ASSETS.read_text(encoding="utf-8")
    listed = re.findall(r"`([0-9a-f]{8})[0-9a-f]{56}`", page)
    assert len(listed) == len(set(listed))
    assert set(listed) == {key for recipe in read_recipes(FROZEN) for key in (recipe.map_id, recipe.shape_id)}
    assert not re.search(r"(^|\s)/[a-z]+/", page)


def test_the_shipped_page_names_no_machine_and_everybody_who_asks_for_it():
    page = SHIPPED.read_text(encoding="utf-8")
    assert str(ROOT) not in page
    assert not re.search(r"(^|\s)/[a-z]+/", page)  # a path of whatever machine
    by_name = "".join(re.findall(r"^### CC BY.*\n\n((?: *- .*\n)+)", page, re.MULTILINE))
    authors = re.findall(r"^- ([^;:\n]+)(?:;.*)?$", by_name, re.MULTILINE)
    assert len(authors) == len(re.findall(r"^- ", by_name, re.MULTILINE)) == 18
    assert "not stated" not in authors
