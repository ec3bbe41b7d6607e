"""What is known of the map itself: read, put into the crop's frame, shown to the network and kept."""

from __future__ import annotations

import json

import numpy as np
import pytest
from PIL import Image
from support.room_photos import FOV_DEG, room_photo, smooth_map
from support.transforms import transforms

import anyprobe
from anyprobe.core.color import to_bytes
from anyprobe.core.latlong import pixel_directions
from anyprobe.core.response import response
from anyprobe.estimate.surroundings import read_panorama
from anyprobe.maps.radiance import write_exr, write_hdr

"""What is seen does not go on beside it."""


def test_a_panorama_is_read_as_far_as_it_is_known(tmp_path):
    picture = np.zeros((128, 256, 4), np.uint8)
    picture[:, :, :3] = (200, 100, 50)
    picture[:64, :, 3] = 255
    Image.fromarray(picture).save(tmp_path / "p.png")
    for source in (picture, tmp_path / "p.png", (tmp_path / "p.png").read_bytes()):
        surroundings_map = read_panorama(source)
        assert surroundings_map.shape == (64, 128, 4)
        np.testing.assert_allclose(
            surroundings_map[:32], [*np.array([200, 100, 50]) / 255, 1.0] * np.ones((32, 128, 1)), atol=1e-3
        )
        assert not surroundings_map[32:].any()
    assert (read_panorama(picture[..., :3])[..., 3] == 1).all()


def lit_room() -> np.ndarray:
    """[64, 128, 3]: the soft map with an emitter of radiance 40, whose borders are the map's own pixels'."""
    radiance = smooth_map()
    radiance[20:24, 60:66] = [40.0, 30.0, 20.0]
    return radiance


def test_surroundings_change_the_light_and_are_noted():
    photo, mask = room_photo(smooth_map())
    alone = anyprobe.estimate(photo, mask=mask, fov_deg=FOV_DEG, surroundings="none")
    hints = anyprobe.estimate(photo, mask=mask, fov_deg=FOV_DEG, surroundings="photo")
    assert alone.sidecar()["hints"] == {"normals": False}
    assert 0.02 < hints.sidecar()["hints"]["surroundings"] < 0.06
    assert alone.confidence.max() == 0  # a black object tells nothing; what is seen beside it does not hang on that
    assert hints.confidence.max() == pytest.approx(0.9, abs=1e-3)
    behind = pixel_directions(64)[..., 2] > 0.3
    assert np.abs(hints.radiance - alone.radiance)[behind].mean() > 1e-4  # not only where it was seen
    panorama = to_bytes(response(smooth_map()))
    whole = anyprobe.estimate(photo, mask=mask, fov_deg=FOV_DEG, surroundings=panorama)
    assert whole.sidecar()["hints"]["surroundings"] == 1.0
    assert np.median(np.abs(response(whole.radiance) - response(smooth_map()))) < 0.01


def test_the_command_line_tells_surroundings(tmp_path, command):
    photo, mask = room_photo(smooth_map())
    Image.fromarray(photo).save(tmp_path / "disc.png")
    Image.fromarray(mask).save(tmp_path / "mask.png")
    Image.fromarray(to_bytes(response(smooth_map()))).save(tmp_path / "pano.png")
    call = ("estimate", tmp_path / "disc.png", "--mask", tmp_path / "mask.png", "--fov", "60", "--json")
    call = (*call, "-o", tmp_path / "out")
    for given, share in (("photo", 0.04), (tmp_path / "pano.png", 1.0)):
        done = command(*call, "--surroundings", given)
        assert done.status == 0, done.err
        assert json.loads(done.out)["hints"]["surroundings"] == pytest.approx(share, abs=0.02)
    refused = command(*call, "--surroundings", tmp_path / "mask.png")
    assert refused.status == 2
    assert "twice as wide" in refused.err


@pytest.mark.ci
@pytest.mark.parametrize("kind", ["exr", "hdr"])
def test_the_emitters_of_a_panorama_come_through_the_command(tmp_path, command, kind):
    """The network is told white there; several photos know them too, the panorama being the first one's."""
    photo, mask = room_photo(smooth_map())
    for name in ("disc", "other"):
        Image.fromarray(np.dstack([photo, mask])).save(tmp_path / f"{name}.png")
    (write_hdr if kind == "hdr" else write_exr)(tmp_path / f"pano.{kind}", lit_room())
    (tmp_path / "poses.json").write_text(transforms([np.eye(3)] * 2, ("disc.png", "other.png")))
    call = ("--fov", FOV_DEG, "--surroundings", tmp_path / f"pano.{kind}", "-o", tmp_path / "out", "-q")
    for several in ((), (tmp_path / "other.png", "--poses", tmp_path / "poses.json")):
        done = command("estimate", tmp_path / "disc.png", *several, *call)
        assert done.status == 0, done.err
        found = anyprobe.Light.load(tmp_path / "out" / "disc.exr")
        truth = lit_room()
        assert found.radiance.max() == pytest.approx(40, rel=0.25)  # turned to the crop and back
        assert found.dominant_light().direction @ anyprobe.Light(radiance=truth).dominant_light().direction > 0.998
        power = found.dominant_light().irradiance / anyprobe.Light(radiance=truth).dominant_light().irradiance
        np.testing.assert_allclose(power, 1.0, atol=0.15)
