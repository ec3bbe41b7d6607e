"""anyprobe estimate and what it is given: every bad input is one line and exit status 2, and writes nothing."""

from __future__ import annotations

import io
import json
import struct
import zlib
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from PIL import Image
from support.folders import snapshot
from support.transforms import transforms

from anyprobe.cli.photo_files import hints_for
from anyprobe.core.response import response
from anyprobe.files.paths import natural_order
from anyprobe.inputs.hints import Hints
from anyprobe.maps.radiance import read_radiance

pytestmark = pytest.mark.usefixtures("small_masks")


def png_with_size(width: int, height: int) -> bytes:
    """A PNG whose header tells a size that its pixels do not have."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + header + chunk(b"IDAT", zlib.compress(b"\0" * 64)) + chunk(b"IEND", b"")


def write_exr(path, rgba: np.ndarray) -> None:
    values = np.ascontiguousarray(rgba, dtype=np.float32)
    OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION}, {"RGBA": values}).write(str(path))


def bad_photo(kind: str, rgba: np.ndarray):
    """Bytes of photos that cannot be used."""
    noise = np.random.default_rng(0).integers(0, 256, (96, 128, 3), dtype=np.uint8)
    if kind == "text":
        return b"This is a letter and no photo.\n"
    if kind == "empty":
        return b""
    if " x " in kind:
        return png_with_size(*map(int, kind.split(" x ")))
    path = "scratch.exr" if kind == "NaN" else "scratch.jpg" if kind == "cut" else "scratch.png"
    if kind == "NaN":
        linear = rgba.astype(np.float32) / 255
        linear[48, 64, 1] = np.nan
        write_exr(path, linear)
    elif kind == "1x1":
        Image.new("RGBA", (1, 1)).save(path)
    else:
        Image.fromarray(noise).save(path)
    with open(path, "rb") as file:
        data = file.read()
    return data[: len(data) // 2] if kind == "cut" or kind == "cut PNG" else data


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("text", ("expected an image", "31 bytes")),
        ("empty", ("empty file",)),
        ("cut", ("damaged",)),
        ("cut PNG", ("damaged",)),
        ("1x1", ("1 x 1", "at least 32")),
        ("30000 x 30000", ("100 million pixels",)),
        ("12000 x 12000", ("100 million pixels",)),  # the image library itself would open it
        ("NaN", ("NaN",)),
    ],
)
def test_unusable_photo(work, command, photo_rgba, mask_path, kind, words):
    data = bad_photo(kind, photo_rgba)
    for scratch in work.glob("scratch.*"):
        scratch.unlink()
    (work / "photo.png").write_bytes(data)
    (work / "out").mkdir()
    (work / "out" / "photo.json").write_text("older result")
    before = snapshot(work)
    complaint = command("estimate", "photo.png", "-o", "out", "--mask", mask_path).complaint
    for word in ("photo.png", *words):
        assert word in complaint
    assert snapshot(work) == before


def test_photo_that_is_not_there(work, command):
    assert "anyprobe: gone.png: no such file; check the path" in command("estimate", "gone.png", "-o", "out").complaint
    assert list(work.iterdir()) == []


def test_nothing_found_names_the_ways_to_tell(work, command):
    Image.new("RGB", (128, 96), "grey").save("photo.png")
    complaint = command("estimate", "photo.png", "-o", "out").complaint
    for way in ("--click X,Y", "--mask FILE", "--box X0,Y0,X1,Y1", "alpha channel"):
        assert way in complaint
    assert not (work / "out").exists()


@pytest.mark.parametrize("kind", ["empty", "other size", "under 24 px", "no image", "gone", "cut"])
def test_unusable_mask(work, command, photo_path, photo_mask, kind):
    mask = photo_mask.copy()
    if kind == "empty":
        mask[:] = 0
    if kind == "under 24 px":
        mask[:] = 0
        mask[40:63, 40:63] = 255
    if kind == "other size":
        mask = mask[:, :-1]
    Image.fromarray(np.ascontiguousarray(mask)).save("mask.png")
    if kind == "no image":
        (work / "mask.png").write_text("white on the object")
    if kind == "cut":
        (work / "mask.png").write_bytes((work / "mask.png").read_bytes()[:150])
    if kind == "gone":
        (work / "mask.png").unlink()
    before = snapshot(work)
    complaint = command("estimate", photo_path, "-o", "out", "--mask", "mask.png").complaint
    word = {
        "empty": "empty mask",
        "other size": "127 x 96",
        "under 24 px": "24 pixels",
        "no image": "expected an image",
        "gone": "--mask mask.png: no such file or folder; check the path",
        "cut": "damaged",
    }[kind]
    assert word in complaint
    assert snapshot(work) == before


@pytest.mark.parametrize("together", [False, True])
def test_an_error_of_a_mask_names_the_photo_it_is_of(work, command, photo_rgba, photo_mask, together):
    """Once: what names it by itself stays as it is."""
    for folder in ("photos", "masks"):
        (work / folder).mkdir()
    for stem in "abc":
        Image.fromarray(photo_rgba).save(f"photos/{stem}.png")
        Image.fromarray(photo_mask * (stem != "b")).save(f"masks/{stem}.png")
    (work / "poses.json").write_text(transforms([np.eye(3)] * 3, ("a.png", "b.png", "c.png")))
    poses = ("--poses", "poses.json") if together else ()
    outcome = command("estimate", "photos", "--mask", "masks", "-o", "out", "--json", "-q", *poses)
    assert outcome.status == 2
    (line,) = (one for one in outcome.err.splitlines() if one.startswith("anyprobe: "))
    assert line.startswith("anyprobe: photos/b.png: --mask: expected white on the object, got an empty mask")
    if not together:
        given = [json.loads(one) for one in outcome.out.splitlines()]
        assert line == f"anyprobe: {given[1]['error']}"
    (work / "photos" / "b.png").write_text("no photo")
    said = command("estimate", "photos", "--mask", "masks", "-o", "out", "-q", *poses).complaint
    assert said.startswith("anyprobe: b.png: expected an image")


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("--model", "nobody"), "--model: expected one of lift, paper,"),
        (("--model", ""), "expected one of"),
        (("--box", "1,2,3"), "X0,Y0,X1,Y1"),
        (("--box", "a,b,c,d"), "X0,Y0,X1,Y1"),
        (("--box", "0,0,500,500"), "128"),
        (("--fov", "400"), "expected 1 to 170 degrees"),
        (("--fov", "nan"), "expected 1 to 170 degrees"),
        (("--box", "20,10,110,90", "--mask", "photos/sphere.png"), "expected one of them"),
        (("--exclude", "20,10", "--mask", "photos/sphere.png"), "--exclude and --mask: expected one of them"),
        (
            ("--near", "0", "--mask", "photos/sphere.png"),
            "--near: expected a depth image to cut, got none; pass --depth FILE",
        ),
        (("--far", "3"), "--far: expected a depth image to cut, got none; pass --depth FILE"),
        (("--size", "100"), "--size: expected one of 64, 128, 256, 512, 1024, 2048 rows, got 100"),
        (("--material", "granite"), "--material: expected one of chrome"),
        (("--albedo", "7"), "--albedo: expected one number"),
        (("--material", "gold", "--model", "paper"), "got paper; pass --model lift, or leave out --material"),
    ],
)
def test_senseless_option(work, command, photo_path, arguments, word):
    before = snapshot(work)
    assert word in command("estimate", "photos/sphere.png", "-o", "out", *arguments).complaint
    assert snapshot(work) == before


@pytest.mark.parametrize(
    "words",
    [
        ("estimate", "sphere.png", "-o", "out.exr"),
        ("mask", "sphere.png", "-o", "out.PNG"),
        ("match", "sphere.png", "maps", "-o", "out.exr"),
        ("video", "clip.mp4", "-o", "out.mp4"),
        ("export", "sphere.exr", "--to", "usd", "-o", "out.usda"),
    ],
)
def test_a_file_is_no_folder_for_results(work, command, words):
    name = words[-1]
    wanted = f"anyprobe: -o {name}: expected a folder, got a name that ends in {Path(name).suffix}; "
    assert command(*words).complaint.startswith(wanted)
    assert list(work.iterdir()) == []


def test_a_folder_that_is_there_or_has_a_dot_takes_results(work, command, photo_path):
    (work / "out.exr").mkdir()
    for out in ("out.exr", "v1.2"):
        assert command("estimate", photo_path, "-o", out).status == 0
        assert (work / out / "sphere.exr").is_file()


def test_folder_without_photos(work, command):
    (work / "empty").mkdir()
    assert "empty: no photos in this folder" in command("estimate", "empty").complaint


def test_box_cuts_the_object_out(work, command, photo_rgba):
    Image.fromarray(photo_rgba[..., :3]).save("photo.png")
    outcome = command("estimate", "photo.png", "--box", "24,8,104,88", "--json")
    assert outcome.status == 0, outcome.err
    crop = json.loads(outcome.out)["crop"]
    assert crop["center_px"] == pytest.approx([64, 48], abs=3)  # the sphere, not the box's surroundings


# Odd inputs that are fine


@pytest.mark.ci
def test_odd_kinds_of_photos_are_converted(work, command, photo_rgba, mask_path):
    """One mask serves them all; each says the same as its plain RGB twin, or nearly so after JPEG."""
    rgb = Image.fromarray(np.ascontiguousarray(photo_rgba[..., :3]))
    grey = rgb.convert("L")
    palette = rgb.quantize(200)
    odd = work / "odd"
    odd.mkdir()
    rgb.convert("CMYK").save(odd / "cmyk.jpg", quality=95)
    palette.save(odd / "palette.png")
    palette.convert("RGB").save(odd / "palette_twin.png")
    grey.save(odd / "grey.png")
    grey.convert("RGB").save(odd / "grey_twin.png")
    Image.fromarray(np.asarray(grey).astype(np.uint16) * 257).save(odd / "sixteen.png")
    palette.save(odd / "animated.gif", save_all=True, append_images=[Image.new("RGB", rgb.size, "lime")] * 2)
    rgb.save(odd / "plain.png")
    outcome = command("estimate", "odd", "-o", "out", "--mask", mask_path)
    assert outcome.status == 0, outcome.err
    found = [path for path in (work / "out").glob("*.exr") if not path.stem.endswith("_panorama")]
    maps = {path.stem: read_radiance(path) for path in found}
    assert len(maps) == 8
    np.testing.assert_array_equal(maps["palette"], maps["palette_twin"])
    np.testing.assert_array_equal(maps["grey"], maps["grey_twin"])
    np.testing.assert_array_equal(maps["sixteen"], maps["grey"])
    assert np.abs(maps["grey"] - maps["plain"]).max() > 1e-3
    # as shown: an emitter's radiance is a matter of a few bits
    shown = {name: response(radiance) for name, radiance in maps.items()}
    for name, twin in (("cmyk", "plain"), ("animated", "palette")):  # of the animation the first frame
        off = np.abs(shown[name] - shown[twin])
        assert off.mean() < 0.015, name
        assert np.quantile(off, 0.999) < 0.06, name  # but for a source that stands a pixel further


def test_own_transparency_of_every_kind_is_a_mask(work, command, photo_rgba):
    rgb, alpha = Image.fromarray(np.ascontiguousarray(photo_rgba[..., :3])), photo_rgba[..., 3]
    grey_alpha = Image.merge("LA", [rgb.convert("L"), Image.fromarray(alpha)])
    grey_alpha.save("grey_alpha.png")
    quantized = rgb.quantize(200)
    palette = Image.fromarray(np.where(alpha == 0, 255, np.asarray(quantized)).astype(np.uint8))
    colors = quantized.getpalette()
    palette.putpalette(colors + [0] * (768 - len(colors)))
    palette.save("palette_alpha.png", transparency=255)
    write_exr("linear.exr", photo_rgba.astype(np.float32) / 255)
    photos = ("grey_alpha.png", "palette_alpha.png", "linear.exr")
    outcome = command("estimate", *photos, "-o", "out", "--json")
    assert outcome.status == 0, outcome.err
    for line in outcome.out.splitlines():
        assert json.loads(line)["crop"]["center_px"] == pytest.approx([64, 48], abs=1)


def test_exif_rotation_is_honoured(work, command, photo_rgba):
    """A phone held upright stores the picture lying: the result is that of the upright one."""
    photo_rgba = np.roll(photo_rgba, (10, -20), axis=(0, 1))
    upright = Image.fromarray(photo_rgba)
    exif = Image.Exif()
    exif[0x0112] = 6
    upright.transpose(Image.Transpose.ROTATE_90).save("lying.png", exif=exif)
    upright.save("upright.png")
    upright.transpose(Image.Transpose.ROTATE_90).save("ignored.png")
    assert command("estimate", "lying.png", "upright.png", "ignored.png").status == 0
    lying, plain, ignored = (read_radiance(f"light/{n}.exr") for n in ("lying", "upright", "ignored"))
    np.testing.assert_array_equal(lying, plain)
    assert np.abs(ignored - plain).max() > 1e-3


@pytest.mark.parametrize(("value", "word"), [(0, "nearly black"), (255, "is clipped")])
def test_black_or_white_object_is_accepted_with_a_warning(work, command, photo_rgba, value, word):
    photo_rgba[..., :3] = value
    Image.fromarray(photo_rgba).save("a rather long name of a photo, so that the line is long, too.png")
    outcome = command("estimate", *work.iterdir(), "-o", "out")
    assert outcome.status == 0
    warned = [line for line in outcome.err.splitlines() if line.startswith("warning: ")]
    assert len(warned) == 1
    assert word in warned[0]
    (sidecar,) = (work / "out").glob("*.json")
    written = json.loads(sidecar.read_text())
    assert written["well_exposed_fraction"] < 0.05
    assert written["confidence"] < 0.05
    assert word in written["warnings"][0]


def test_a_folder_of_panoramas_may_hold_radiance_files(work, photo_rgba):
    (work / "panoramas").mkdir()
    (work / "panoramas" / "room.hdr").touch()
    given = Hints(surroundings=Path("panoramas"))
    assert hints_for(Path("room.jpg"), given).surroundings == Path("panoramas/room.hdr")


def test_names_are_ordered_whatever_digits_they_have():
    names = ["²1.jpg", "a10.jpg", "a2.jpg", "٣.jpg"]
    assert [name for name in sorted(names, key=natural_order) if name.startswith("a")] == ["a2.jpg", "a10.jpg"]


@pytest.mark.ci
@pytest.mark.parametrize(
    ("order", "written"),
    [
        (("estimate", "-"), "light/stdin.exr"),
        (("mask", "-"), "masks/stdin_mask.png"),
        (("relight", "-", "--renderer", "own"), "relit/stdin_relit.png"),
    ],
)
def test_a_photo_may_come_from_standard_input(command, photo_path, work, monkeypatch, order, written):
    for data, status in ((photo_path.read_bytes(), 0), (b"This is no photo.", 2)):
        monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(data)))
        done = command(*order)
        assert done.status == status, done.err
        assert Path(written).is_file() == (status == 0)
        Path(written).unlink(missing_ok=True)
    assert done.err.startswith("anyprobe: stdin: expected an image"), done.err
