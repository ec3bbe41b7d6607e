"""anyprobe estimate and what it leaves: files, table, JSON, exit status, and nothing half-written."""

from __future__ import annotations

import errno
import json
import os
import signal
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from PIL import Image
from rich.console import Console
from support.folders import names, snapshot
from support.scenes import sphere_photo

import anyprobe
from anyprobe.cli.app import app
from anyprobe.cli.estimate import Done, _report, said_of
from anyprobe.cli.photo_files import joined
from anyprobe.core.frames import normalize
from anyprobe.core.latlong import pixel_directions
from anyprobe.files import atomic
from anyprobe.maps.radiance import read_radiance
from anyprobe.notices import Notice, give

SUFFIXES = {".exr", ".hdr", ".json", ".png", "_panorama.exr", "_origin.png"}
pytestmark = pytest.mark.usefixtures("small_masks")


def save_sphere(path: str | Path, center=(64, 48), alpha: bool = True) -> Path:
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    rgba = Image.fromarray(sphere_photo(center))
    (rgba if alpha else rgba.convert("RGB")).save(path)
    return path


def save_mask(path: str | Path, center=(64, 48)) -> Path:
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(np.ascontiguousarray(sphere_photo(center)[..., 3])).save(path)
    return path


def results(*stems: str) -> set[str]:
    return {stem + suffix for stem in stems for suffix in SUFFIXES}


def shell(*arguments: object, code: str = "", **options) -> subprocess.CompletedProcess:
    """The command in a process of its own; code runs before it there."""
    program = f"{code}\nfrom anyprobe.cli.app import main; main()"
    call = [sys.executable, "-c", program, *map(str, arguments)]
    return subprocess.run(call, capture_output=True, text=True, timeout=120, **options)


# What one photo leaves


@pytest.mark.ci
def test_files_that_agree(work, command):
    save_sphere("vase.png")
    outcome = command("estimate", "vase.png", "-o", "out")
    assert outcome.status == 0, outcome.err
    assert outcome.out == ""
    assert names("out") == results("vase")
    light = anyprobe.estimate("vase.png")
    np.testing.assert_allclose(read_radiance("out/vase.exr"), light.radiance, rtol=2**-11, atol=1e-6)
    hdr = read_radiance("out/vase.hdr")
    assert (np.abs(hdr - light.radiance) <= light.radiance.max(axis=-1, keepdims=True) / 255).all()
    sidecar = json.loads((work / "out" / "vase.json").read_text())
    np.testing.assert_allclose(sidecar["sh9"], light.sh9(), atol=1e-6)
    np.testing.assert_allclose(sidecar["dominant_light"]["direction"], light.dominant_light().direction, atol=1e-6)
    assert sidecar["photo"] == "vase.png"
    with OpenEXR.File("out/vase.exr", header_only=True) as file:
        header = file.header()
        assert header["envmap"] == OpenEXR.ENVMAP_LATLONG
        assert header["anyprobe:model"] == sidecar["model"]


@pytest.mark.ci
def test_older_results_are_replaced(work, command):
    save_sphere("vase.png", center=(40, 40))
    assert command("estimate", "vase.png").status == 0
    first = snapshot(work / "light")
    save_sphere("vase.png", center=(80, 56))
    assert command("estimate", "vase.png").status == 0
    second = snapshot(work / "light")
    assert set(first) == set(second) == results("vase")
    assert all(first[name] != second[name] for name in first if "_origin" not in name)  # all of a cut-out is estimated


@pytest.mark.ci
def test_json_lines_and_nothing_else(work, command):
    save_sphere("a.png")
    Image.new("RGB", (128, 96), "grey").save("b.png")  # nothing to be found
    save_sphere("c.png", center=(40, 50))
    outcome = command("estimate", "a.png", "b.png", "c.png", "-o", "out", "--json")
    assert outcome.status == 2
    a, b, c = (json.loads(line, parse_constant=pytest.fail) for line in outcome.out.splitlines())
    assert [one["photo"] for one in (a, b, c)] == ["a.png", "b.png", "c.png"]
    assert "--mask FILE" in b["error"]
    assert "sh9" not in b
    for one in (a, c):
        sidecar = json.loads(Path(one["files"]["json"]).read_text())
        assert one["sh9"] == sidecar["sh9"]
        assert {Path(file).name.removeprefix(Path(one["photo"]).stem) for file in one["files"].values()} == SUFFIXES
        assert all(Path(file).is_file() for file in one["files"].values())


@pytest.mark.ci
def test_quiet_says_nothing_but_errors(work, command):
    save_sphere("a.png")
    outcome = command("estimate", "a.png", "-q")
    assert (outcome.status, outcome.out, outcome.err) == (0, "", "")
    Image.new("RGB", (128, 96), "grey").save("b.png")  # nothing to be found
    outcome = command("estimate", "a.png", "b.png", "-q")
    assert outcome.complaint.startswith("anyprobe: b.png: ")


# Several photos


def test_what_is_doubted_of_several_photos_is_one_line(capsys):
    def done(name: str) -> Done:
        doubts = Notice("no field of view", source=name), Notice("dark", source=f"{name[0]}.png"), Notice("all")
        return Done(photo=Path(name), stem=name, cells=("", "", ""), warnings=doubts)

    stems = [f"{letter}{number}" for letter in "ab" for number in range(40)]
    _report([done(name) for name in stems], Console(stderr=True, width=300), Path("out"))
    said = [line for line in capsys.readouterr().err.splitlines() if line.startswith("warning: ")]
    assert said == ["warning: 80 photos: no field of view", "warning: a.png, b.png: dark", "warning: all"]


def test_a_kind_of_warning_is_said_once_with_what_differs():
    def wrong(name: str, why: str) -> Notice:
        text = f"the mask may be wrong: {why}; check it"
        return Notice(text, code="mask-doubtful", source=name, remedy=give("box"))

    lost = Notice("the mask does not hold the click at 3,9; remove it", code="mask-doubtful", source="a.png")
    given = [wrong("a.png", "61% of it"), lost, wrong("b.png", "a box cuts"), wrong("c.png", "61% of it")]
    assert list(joined(given)) == [
        "the mask may be wrong: 61% of it (a.png, c.png), a box cuts (b.png); check it; pass box=",
        str(lost),
    ]


@pytest.mark.ci
def test_one_bad_photo_does_not_stop_the_others(work, command):
    save_sphere("first.png")
    (work / "second.png").write_text("no photo")
    save_sphere("third.png")
    outcome = command("estimate", "first.png", "second.png", "third.png", "-o", "out")
    assert outcome.status == 2
    assert names("out") == results("first", "third")
    lines = outcome.err.splitlines()
    assert lines[:3] == ["1 of 3: first.png", "2 of 3: second.png", "3 of 3: third.png"]
    table = lines[3:]
    assert "dominant light" in table[0]
    assert [row.split()[0] for row in table[1:4]] == ["first.png", "second.png", "third.png"]
    assert "failed" in table[2]
    assert any(
        line.startswith("results: out/<stem>_panorama.exr, <stem>_origin.png, <stem>.exr,") for line in table[4:]
    )
    assert [line for line in table if line.startswith("anyprobe: ")] == table[5:]
    assert len(table) == 6
    assert "second.png" in table[5]


@pytest.mark.parametrize(
    ("toward", "error_deg", "text"),
    [
        ((0.6, 0.0, -0.8), 12.0, "37° right, 0° up ± 12°"),
        ((0.1, 1.0, 0.1), 12.0, "82° up ± 12°"),
        ((0.9, 0.3, 0.1), 81.0, "probably from the right ± 81°"),
    ],
)
def test_a_direction_says_no_more_than_is_known(toward, error_deg, text):
    near = pixel_directions(64) @ normalize(np.array(toward)) > 0.995
    photo = np.full((128, 128, 4), [0.2, 0.2, 0.2, 1.0], np.float32)
    radiance = np.where(near, 100.0, 0.1)[..., None] * np.ones(3)
    light = anyprobe.Light(radiance=radiance, stages={"photo": photo}, said_error_deg=error_deg)
    assert said_of(light)[0] == text


@pytest.mark.ci
def test_results_of_a_folder_are_named_as_they_are_written(work, command):
    save_sphere("a.png")
    save_sphere("a.tif")
    save_sphere("b.png")
    outcome = command("estimate", ".", "-o", "out")
    assert names("out") == results("a_png", "a_tif", "b")
    assert outcome.err.rstrip().endswith("<stem>.json, <stem>.png; <stem> is a_png, a_tif, b")


@pytest.mark.ci
def test_folders_and_files_together(work, command):
    save_sphere("many/a.png")
    save_sphere("many/b.webp", center=(40, 48))
    (work / "many" / "notes.txt").write_text("not a photo")
    save_sphere("single.tif")
    assert command("estimate", "many", "single.tif", "many/a.png", "-o", "out").status == 0
    assert names("out") == results("a", "b", "single")


@pytest.mark.ci
def test_masks_from_a_folder_by_stem(work, command):
    centers = {"left": (40, 48), "right": (90, 50)}
    for stem, center in centers.items():
        save_sphere(f"photos/{stem}.png", center, alpha=False)
    save_mask("masks/left.png", centers["left"])
    save_mask("masks/right_mask.webp", centers["right"])
    save_mask("masks/leftover.png", centers["right"])
    outcome = command("estimate", "photos", "--mask", "masks", "-o", "out", "--json")
    assert outcome.status == 0, outcome.err
    for line in outcome.out.splitlines():
        one = json.loads(line)
        assert one["crop"]["center_px"] == pytest.approx(centers[Path(one["photo"]).stem], abs=1)


def test_mask_missing_from_the_folder_fails_that_photo_alone(work, command):
    save_sphere("photos/a.png")
    save_sphere("photos/b[1].png", alpha=False)
    save_mask("masks/b[1].png")
    outcome = command("estimate", "photos", "--mask", "masks", "-o", "out")
    assert outcome.status == 2
    assert names("out") == results("b[1]")
    assert "expected a.png or a_mask.png in masks, got neither" in outcome.err


def test_masks_beside_the_photos_are_no_photos(work, command):
    save_sphere("photos/a.jpg", alpha=False)
    save_mask("photos/a_mask.png")
    assert command("estimate", "photos", "--mask", "photos", "-o", "out").status == 0
    assert names("out") == results("a")


def test_two_photos_of_one_name(work, command):
    save_sphere("one/vase.png", center=(40, 48))
    save_sphere("two/vase.png")
    outcome = command("estimate", "one/vase.png", "two/vase.png", "-o", "out", "--json")
    assert outcome.status == 2
    assert "two/vase.png: expected distinct result names, got one/vase.png before it" in outcome.err
    assert not (work / "out").exists()


@pytest.mark.ci
def test_odd_names_reach_table_and_files(work, command):
    stems = ["[bold]vase[red]", ":smile:", "-o", "ünï", "two words", "line\nbreak"]
    for stem in stems:
        save_sphere(f"photos/{stem}.png")
    (work / "photos" / "also\nbroken.png").write_text("no photo")
    outcome = command("estimate", "photos", "-o", "out")
    assert outcome.status == 2
    assert names("out") == results(*stems)
    for stem in stems[:-1]:
        assert f"{stem}.png " in outcome.err
    assert sum(line.startswith("anyprobe: ") for line in outcome.err.splitlines()) == 1
    assert "also broken.png" in outcome.err.splitlines()[-1]


# What must not be replaced


def test_result_never_replaces_an_input(work, command):
    save_sphere("vase.png")
    before = snapshot(work)
    for folder in (".", work, "../" + work.name):
        assert "would replace vase.png" in command("estimate", "vase.png", "-o", folder).complaint
    assert snapshot(work) == before


def test_result_never_replaces_another_photo_or_a_mask(work, command):
    save_sphere("vase.jpg", alpha=False)
    save_sphere("vase_jpg.png")
    save_sphere("vase.webp")
    save_mask("vase_webp.png")
    save_mask("pot.png")
    save_sphere("pot.jpg", alpha=False)
    before = snapshot(work)
    outcome = command("estimate", "vase.jpg", "vase_jpg.png", "vase.webp", "-o", ".", "--mask", "vase_webp.png")
    assert outcome.status == 2
    assert "expected distinct result names" in outcome.err
    assert "would replace pot.png" in command("estimate", "pot.jpg", "--mask", "pot.png", "-o", ".").complaint
    assert "would replace pot.png" in command("estimate", "pot.jpg", "--mask", ".", "-o", ".").complaint
    assert snapshot(work) == before


# What cannot be written


@pytest.mark.parametrize("folder", ["file", "file/deeper", "/proc/nowhere"])
def test_output_folder_that_cannot_be_written(work, command, folder):
    save_sphere("vase.png")
    (work / "file").write_text("a file")
    before = snapshot(work)
    said = {"file": "file: is a", "file/deeper": "file/deeper: file is a"}.get(folder)
    said = f"{said} file, not a folder; choose another with -o" if said else f"{folder}: cannot be written ("
    assert said in command("estimate", "vase.png", "-o", folder).complaint
    assert snapshot(work) == before


def no_space(*args, **kwargs):
    raise OSError(errno.ENOSPC, "No space left on device")


@pytest.mark.parametrize("where", ["mkdir", "scratch", "hdr", "json", "png", 0, 6, 11])
def test_disk_full_leaves_what_was_there(work, command, monkeypatch, where):
    save_sphere("vase.png")
    if where != "mkdir":
        (work / "out").mkdir()
        (work / "out" / "other.exr").write_text("older")
    before = snapshot(work)
    broken = {
        "mkdir": (Path, "mkdir"),
        "scratch": (atomic.tempfile, "TemporaryDirectory"),
        "hdr": (Path, "write_bytes"),
        "json": (Path, "write_text"),
        "png": (Image.Image, "save"),
    }
    if where in broken:
        monkeypatch.setattr(*broken[where], no_space)
    else:  # at the n-th rename, six into the hidden folder and six out of it
        rename, calls = os.replace, []

        def replace(source, target):
            calls.append(target)
            return no_space() if len(calls) == where + 1 else rename(source, target)

        monkeypatch.setattr(os, "replace", replace)
    outcome = command("estimate", "vase.png", "-o", "out")
    monkeypatch.undo()
    assert "No space left on device" in outcome.complaint
    assert "out" in outcome.complaint
    assert ".anyprobe-" not in outcome.complaint
    assert snapshot(work) == before
    assert names("out") <= {"other.exr"}


@pytest.mark.ci
@pytest.mark.skipif(sys.platform == "win32", reason="no limit of file size")
def test_real_write_that_stops_halfway(work):
    """The system itself refuses bytes: at once, within the map, within the preview."""
    save_sphere("vase.png")
    code = """
import resource
from anyprobe.cli.app import main
for limit in (0, 9_000, 60_000):
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, -1))
    try:
        main()
    except SystemExit as end:
        print(end.code)
"""
    words = ("estimate", "vase.png", "-o", "out", "--size", "64")
    ended = subprocess.run([sys.executable, "-c", code, *words], capture_output=True, text=True, timeout=120)
    assert ended.stdout == "2\n2\n2\n", ended.stderr
    lines = ended.stderr.splitlines()
    assert len(lines) == 3
    assert all("File too large" in line for line in lines)
    assert names("out") == set()


@pytest.mark.ci
@pytest.mark.skipif(sys.platform == "win32", reason="no limit of file size")
def test_small_map_cut_by_the_last_flush_is_noticed(work):
    """A map of one colour fits into the writer's buffer, whose loss it does not report."""
    even = anyprobe.Light(radiance=np.ones((64, 128, 3)))
    size = even.save("whole.exr").stat().st_size
    code = f"""
import numpy, resource, anyprobe
even = anyprobe.Light(radiance=numpy.ones((64, 128, 3)))
for missing in (1, 300, 900):
    resource.setrlimit(resource.RLIMIT_FSIZE, ({size} - missing, -1))
    try:
        even.save("cut.exr")
    except anyprobe.OutputError:
        print(missing)
"""
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert ended.stdout.split() == ["1", "300", "900"], ended.stderr
    assert names(work) == {"whole.exr"}


# Interrupted


@pytest.mark.ci
@pytest.mark.parametrize("moment", ["session.draw_preview", "os.replace"])
def test_interrupt_leaves_no_temporary_files(work, moment):
    save_sphere("a.png")
    save_sphere("b.png")
    code = f"""
import os, signal
from anyprobe import session
session.draw_preview = lambda panorama, *_: panorama.radiance.clip(0, 1)
whole = {moment}
def interrupted(*args):
    if interrupted.count == 0:
        signal.raise_signal(signal.SIGINT)
    interrupted.count -= 1
    return whole(*args)
interrupted.count = {1 if moment == "session.draw_preview" else 13}
{moment} = interrupted
"""
    ended = shell("estimate", "a.png", "b.png", "-o", "out", "--size", 64, code=code)
    assert ended.returncode == 128 + signal.SIGINT
    stopped = "anyprobe: stopped with 1 of 2 photos done, which are in out; the same command starts over"
    assert ended.stderr.splitlines()[-2:] == [stopped, "anyprobe: interrupted"]
    assert names("out") == results("a")


# The command itself, in a process of its own


@pytest.mark.ci
def test_exit_status_for_real(work):
    save_sphere("vase.png")
    good = shell("estimate", "vase.png", "-o", "out", "--json")
    assert good.returncode == 0, good.stderr
    assert json.loads(good.stdout)["photo"] == "vase.png"
    assert names("out") == results("vase")
    with Image.open("out/vase.png") as preview:
        pixels = np.asarray(preview)
    assert pixels.ndim == 3
    assert pixels.shape[0] > 500  # two rows of pictures
    assert pixels.shape[1] > 1024  # as wide as the panorama, and a border
    assert pixels.std() > 10
    (work / "bad.jpg").write_text("no photo")
    bad = shell("estimate", "bad.jpg", "-o", "out")
    assert (bad.returncode, bad.stdout) == (2, "")
    assert bad.stderr.startswith("anyprobe: bad.jpg: expected an image")
    assert bad.stderr.count("\n") == 1
    assert names("out") == results("vase")


def test_help_and_version(command):
    assert command("--version").out == f"anyprobe {anyprobe.__version__}\n"
    shown = command("estimate", "--help")
    assert shown.status == 0
    for word in ("PHOTO...", "--mask", "--box", "X0,Y0,X1,Y1", "--fov", "--model", "--json", "-o"):
        assert word in shown.out
    assert command("estimate").status == 2
    assert command("estimate", "--nonsense").status == 2


def test_photos_may_stand_between_options_and_the_last_of_two_counts():
    words = ["estimate", "a.png", "-o", "out", "b.png", "--click", "-1,2", "--click=3,4", "--fov", "40", "--fov", "50"]
    _, bound, _ = app.parse_args(words)
    assert bound.args == (Path("a.png"), Path("b.png"))
    assert (bound.kwargs["given"].click, bound.kwargs["given"].fov_deg) == (["-1,2", "3,4"], 50.0)


# What is refused before any network runs


@pytest.mark.parametrize("name", ["estimate", "mask"])
def test_names_and_folder_are_checked_before_the_work(work, command, name, monkeypatch):
    for folder in ("a", "b"):
        save_sphere(f"{folder}/vase.png")
    (work / "file").write_text("a file")
    for module in ("anyprobe.estimate.photo", "anyprobe.masks.find"):
        monkeypatch.setattr(import_module(module), "find_mask", None)
    assert "expected distinct result names" in command(name, "a/vase.png", "b/vase.png", "-o", "out").complaint
    assert "file is a file, not a folder" in command(name, "a/vase.png", "-o", "file/deeper").complaint


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("match", "a.png", "maps", "--best", "0"), "--best: expected 1 to 50, got 0"),
        (("match", "a.png", "maps", "--best", "51"), "--best: expected 1 to 50, got 51"),
        (("match", "a.png", "maps", "--apply", "maya"), "--apply: expected any of three, blender,"),
        (("video", "a.mp4", "--every", "0"), "--every: expected 1 or more, got 0"),
        (("estimate", "a.png", "--threads", "1.5"), "--threads: expected a whole number of 1 or more, got 1.5"),
        (("estimate", "a.png", "--surroundngs", "x"), "Unknown option: --surroundngs. Did you mean --surroundings?"),
        (("export", "a.exr"), "--to: expected any of three, blender,"),
        (("export", "a.exr", "--to", "maya"), "--to: expected any of three, blender,"),
        (("relight", "folder", "-o", "x"), "PHOTO folder: is a folder; name one photo"),
        (("mask", ""), "expected a path or a value, got an empty one"),
        (("estimate", "a.png", "--mask", ""), "expected a path or a value, got an empty one"),
    ],
)
def test_what_is_refused_is_said_in_one_line_by_the_option(work, command, words, said):
    (work / "folder").mkdir()
    assert command(*words).complaint.startswith(f"anyprobe: {said}")
