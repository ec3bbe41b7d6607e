"""Every parser of files by name: whole files of it, and how it is called."""

from __future__ import annotations

import io
import json
import tempfile
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import lru_cache, partial
from pathlib import Path

import numpy as np
import OpenEXR
from PIL import Image
from support import picture_files
from support.hostile_files import instanced_glb, multipart_exr

from anyprobe.estimate import poses
from anyprobe.estimate.normals_hint import read_normals
from anyprobe.estimate.result import Light
from anyprobe.export.exported_light import check_front, sidecar_beside
from anyprobe.files import objects
from anyprobe.maps import image_io, radiance
from anyprobe.masks.depth import read_depth
from anyprobe.pictures import declared_size, images
from anyprobe.video.clip import open_clip, read_frames

CASES = Path(__file__).parents[1] / "product/cases"


@lru_cache(maxsize=1)
def folder() -> Path:
    """Where inputs are put for parsers of paths; in memory, where there is such a place."""
    shared = Path("/dev/shm")
    return Path(tempfile.mkdtemp(prefix="anyprobe-", dir=shared if shared.is_dir() else None))


def by_path(suffix: str, read: Callable[[Path], object]) -> Callable[[bytes], object]:
    """A parser of paths as one of bytes."""

    def call(data: bytes) -> object:
        path = folder() / f"input{suffix}"
        path.write_bytes(data)
        return read(path)

    return call


def saved(image: Image.Image, kind: str, **options) -> bytes:
    stream = io.BytesIO()
    image.save(stream, format=kind, **options)
    return stream.getvalue()


def photos() -> list[bytes]:
    rgb = np.random.default_rng(0).integers(0, 255, (40, 48, 3), np.uint8)
    image = Image.fromarray(rgb).resize((48, 40))
    grey, clear = image.convert("L"), image.convert("RGBA")
    exif = Image.Exif()
    exif[0x0112] = 6
    exif.get_ifd(0x8769).update({0xA405: 28, 0x829A: 0.01, 0x8827: 100, 0x829D: 2.8})
    found = [
        saved(image, "JPEG", exif=exif),
        saved(image, "JPEG", progressive=True, quality=40),
        saved(image.convert("CMYK"), "JPEG"),
        saved(clear, "PNG", exif=exif),
        saved(image.quantize(16), "PNG"),
        saved(Image.fromarray(np.arange(40 * 48, dtype=np.uint16).reshape(40, 48)), "PNG"),
        saved(image, "WEBP", exif=exif),
        saved(clear, "WEBP", lossless=True),
        saved(image, "BMP"),
        saved(grey, "PPM"),
        saved(image, "GIF", save_all=True, append_images=[grey.convert("RGB")]),
        saved(image, "MPO", save_all=True, append_images=[grey.convert("RGB")]),
    ]
    for compression in (None, "tiff_lzw", "tiff_adobe_deflate", "jpeg", "packbits"):
        found.append(saved(image, "TIFF", compression=compression, exif=exif))
    found.append(saved(Image.fromarray(np.random.default_rng(0).random((40, 48), np.float32)), "TIFF"))
    for kind in ("JPEG2000", "AVIF"):
        if kind in Image.SAVE or Image.init() and kind in Image.SAVE:
            found.append(saved(image, kind))
    return found


def encoded() -> list[bytes]:
    """Photos that say what their numbers mean, or hold light above white."""
    import zlib

    rgb = picture_files.scene(40, 48)
    grey, deep, wide = rgb[..., 1], picture_files.sixteen(rgb), picture_files.eight(rgb)

    def profiled(pixels: np.ndarray, profile: bytes) -> bytes:
        return picture_files.png(pixels, (b"iCCP", b"x\0\0" + zlib.compress(profile)))

    curve, table = picture_files.gamma_curve(1.8), b"curv\0\0\0\0\0\0\0\x03\0\0\x40\0\xff\xff\0\0"
    found = [
        picture_files.png(wide, (b"cICP", bytes((12, 13, 0, 1)))),
        picture_files.png(deep, (b"cICP", bytes((9, 16, 0, 1)))),
        picture_files.png(wide, (b"gAMA", (100000).to_bytes(4, "big")), (b"cHRM", bytes(range(32)))),
        picture_files.png(picture_files.sixteen(np.dstack([grey, grey])), (b"gAMA", (55556).to_bytes(4, "big"))),
        profiled(deep, picture_files.icc(curve)),
        profiled(deep, picture_files.icc(table)),
        profiled(wide, picture_files.icc(curve)),
        profiled(picture_files.eight(grey), picture_files.icc(curve, grey=True)),
        saved(Image.fromarray(wide), "TIFF", icc_profile=picture_files.icc(curve)),
        picture_files.ultra_hdr(rgb, grey, 3.0, quality=60),
        picture_files.ultra_hdr(rgb, grey, 3.0, iso=True, quality=60),
        picture_files.apple_jpeg(rgb, grey, picture_files.maker_note(0.8, 0.005)),
        picture_files.apple_jpeg(rgb, grey, headroom=4.0),
    ]
    for channels in (1, 3):
        found.append(picture_files.float_tiff(rgb[..., :channels]))
    found.append(picture_files.float_tiff(rgb, profile=picture_files.icc(curve)))
    return found


def with_readers() -> list[bytes]:
    """Of formats whose readers are extras, those that are installed."""
    found = []
    with suppress(ImportError):
        import rawpy  # noqa: F401

        found += [picture_files.dng(picture_files.scene(40, 48))]
    with suppress(ImportError):
        import pillow_heif

        pillow_heif.register_heif_opener()
        rgb = picture_files.scene(64, 64)
        found += [saved(Image.fromarray(picture_files.eight(rgb)), "HEIF")]
        found += [picture_files.apple_heic(rgb, rgb[..., 1], picture_files.maker_note(0.8, 0.005))]
        found += [picture_files.iso_heif(rgb, rgb[..., 1], 3.0)]
    small = picture_files.scene(40, 48)
    found += [image_io.encode_image(picture_files.eight(small), "jpegxl", {})]
    found += [(CASES / name).read_bytes() for name in ("exif.jxl", "grey_alpha.jxl", "rgb16_ramp.jp2")]
    return found


def exrs() -> list[bytes]:
    channels = {name: np.random.default_rng(0).random((32, 64), np.float32) for name in "RGBA"}
    found = [multipart_exr(32, 40), picture_files.yc_exr(picture_files.scene(32, 64))]
    for compression in ("NO", "RLE", "ZIPS", "ZIP", "PIZ", "PXR24", "B44", "DWAA"):
        stream = io.BytesIO()
        header = {
            "compression": getattr(OpenEXR, f"{compression}_COMPRESSION"),
            "type": OpenEXR.scanlineimage,
            "anyprobe:frame": "u = 0.5 + atan2(x, -z) / 2 pi",
            "chromaticities": (0.713, 0.293, 0.165, 0.83, 0.128, 0.044, 0.32168, 0.33767),
        }
        OpenEXR.File(header, dict(channels)).write(stream)
        found.append(stream.getvalue())
    return found


def hdrs() -> list[bytes]:
    path = folder() / "seed.hdr"
    found = []
    for width in (16, 4):
        picture = np.random.default_rng(0).random((width // 2, width, 3), np.float32)
        picture[0] = 0.5
        radiance.write_hdr(path, picture, attributes={"frame": "u = 0.5"})
        found.append(path.read_bytes())
    primaries = b"PRIMARIES=.713 .293 .165 .83 .128 .044 .3217 .3377\nEXPOSURE=2\nFORMAT"
    others = b"COLORCORR=2 1 .5\nGAMMA=1\nEXPOSURE=0\nFORMAT"
    turned = found[0].replace(b"-Y 8 +X 16", b"+X 8 -Y 16")
    return [*found, found[0].replace(b"FORMAT", primaries), found[0].replace(b"FORMAT", others), turned]


def mesh(suffix: str) -> list[bytes]:
    import trimesh

    if suffix == ".glb":
        return [instanced_glb(2), trimesh.creation.box().export(file_type="glb")]
    box = trimesh.creation.box()
    data = box.export(file_type=suffix[1:])
    found = [data if isinstance(data, bytes) else data.encode()]
    if suffix == ".ply":
        found.append(box.export(file_type="ply", encoding="ascii"))
    if suffix == ".obj":
        found.append(
            b"mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\ng a\nf 1/1/1 2/1/1 3/1/1\nf -1 -2 -3\n"
        )
    if suffix == ".stl":
        found.append(trimesh.exchange.stl.export_stl_ascii(box).encode())
    return [one if isinstance(one, bytes) else one.encode() for one in found]


def pose_files() -> list[bytes]:
    turn = np.eye(4).tolist()
    frames = [{"file_path": f"{k}.png", "transform_matrix": turn, "fl_x": 900} for k in range(2)]
    return [json.dumps({"frames": frames, "w": 90, "camera_angle_x": 1.2}).encode()]


def read_all_poses(data: bytes) -> None:
    found = poses.parse_poses(data, "poses")
    found.in_order()
    found.clip_fov_deg(40, 30)
    found.of([Path(f"{k}.png") for k in range(2)])


def sidecars() -> list[bytes]:
    light = Light(radiance=np.full((8, 16, 3), 0.5, np.float32))
    return [json.dumps(light.sidecar()).encode()]


def load_sidecar(data: bytes) -> None:
    path = folder() / "light.hdr"
    if not path.exists():
        radiance.write_hdr(path, np.full((8, 16, 3), 0.5, np.float32))
    path.with_suffix(".json").write_bytes(data)
    check_front(path)
    sidecar_beside(path)
    Light.load(path).sidecar()


def arrays() -> list[bytes]:
    found = []
    for values in (np.full((8, 9, 3), 0.577, np.float32), np.ones((8, 9), np.uint16)):
        stream = io.BytesIO()
        np.save(stream, values)
        found.append(stream.getvalue())
    return found


def clips() -> list[bytes]:
    import av

    found = []
    for kind, codec in (("mp4", "libx264"), ("webm", "libvpx"), ("avi", "mjpeg"), ("gif", "gif")):
        stream = io.BytesIO()
        try:
            with av.open(stream, "w", format=kind) as container:
                track = container.add_stream(codec, rate=10)
                track.width, track.height = 48, 32
                track.pix_fmt = {"gif": "rgb8", "mjpeg": "yuvj420p"}.get(codec, "yuv420p")
                for shade in range(4):
                    picture = av.VideoFrame.from_ndarray(np.full((32, 48, 3), 60 * shade, np.uint8), format="rgb24")
                    container.mux(track.encode(picture.reformat(format=track.pix_fmt)))
                container.mux(track.encode())
        except (av.error.FFmpegError, ValueError):  # this build lacks the codec
            continue
        found.append(stream.getvalue())
    return found


def play(path: Path) -> None:
    frames: Iterable = read_frames(open_clip(path), [])
    for frame, _ in zip(frames, range(4), strict=False):
        assert frame.rgb.ndim == 3


def look(data: bytes) -> None:
    declared_size.declared_pixels(data)
    declared_size.photo_header(data)


PARSERS: dict[str, tuple[Callable[[], list[bytes]], Callable[[bytes], object]]] = {
    "photo": (photos, images.read_image),
    "encoded": (encoded, images.read_image),
    "extra": (with_readers, images.read_image),
    "linear": (lambda: exrs() + hdrs(), images.read_image),
    "header": (lambda: photos() + encoded() + with_readers() + exrs() + hdrs(), look),
    "exr": (exrs, by_path(".exr", radiance.read_radiance)),
    "hdr": (hdrs, by_path(".hdr", radiance.read_radiance)),
    "radiance": (lambda: exrs() + hdrs(), lambda data: radiance.read_linear(data, 1_000_000)),
    "attributes": (lambda: exrs() + hdrs(), by_path(".exr", radiance.map_attributes)),
    **{suffix: (partial(mesh, suffix), by_path(suffix, objects.read_mesh)) for suffix in objects.MESH_SUFFIXES},
    "poses": (pose_files, read_all_poses),
    "sidecar": (sidecars, load_sidecar),
    "normals": (lambda: arrays()[:1], by_path(".npy", lambda path: read_normals(path, (8, 9)))),
    "depth": (lambda: arrays()[1:], by_path(".npy", read_depth)),
    "video": (clips, by_path(".mp4", play)),
}
"""What each parser of files is fed first, and how it is called."""
