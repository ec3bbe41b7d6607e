"""OpenUSD reads the exported stage: dome, distant light, variants, and the package of all of it."""

from __future__ import annotations

import numpy as np
import pytest
from support.two_phase import assert_same_way_round, probe_directions, two_phase

from anyprobe.core.latlong import bilinear
from anyprobe.export.targets import export
from anyprobe.light.light_sources import split_sources
from anyprobe.maps.radiance import read_radiance

pytestmark = pytest.mark.slow
pytest.importorskip("pxr", reason="usd-core is needed (pip install usd-core)")


@pytest.fixture
def radiance():
    radiance = 0.3 * two_phase(64)
    radiance[12:15, 100:104] += (40, 30, 20)
    radiance[40:43, 20:24] += (15, 20, 25)
    return radiance


@pytest.fixture(params=[".usda", ".usdz"])
def stage(request, radiance, tmp_path):
    from pxr import Usd

    paths = export(radiance, "usd", tmp_path, "two phase")
    return Usd.Stage.Open(str(next(path for path in paths if path.suffix == request.param)))


def dome_map(stage):
    """The dome's texture as its own formula reads it along our directions."""
    from pxr import UsdGeom, UsdLux

    dome = UsdLux.DomeLight(stage.GetPrimAtPath("/Light/Dome"))
    assert dome.GetTextureFormatAttr().Get() == "latlong"
    assert dome.GetIntensityAttr().Get() == 1
    matrix = np.array(UsdGeom.Xformable(dome).ComputeLocalToWorldTransform(0))
    np.testing.assert_allclose(matrix, np.eye(4))  # the roll is in the file
    asset = dome.GetTextureFileAttr().Get()
    assert asset.resolvedPath
    return asset


def test_dome_is_turned_or_mirrored(stage, tmp_path):
    stage.GetPrimAtPath("/Light").GetVariantSets().GetVariantSet("sources").SetVariantSelection("inTheDome")
    asset = dome_map(stage)
    picture = read_radiance(tmp_path / asset.path.removeprefix("./"))
    d = probe_directions(100)
    x, y, z = d.T
    uv = np.stack([0.5 - np.arctan2(x, z) / (2 * np.pi), np.arccos(y) / np.pi], axis=-1)
    seen = bilinear(picture, uv)
    even = seen.max(axis=1) < 1  # off the emitter
    assert even.sum() > 90
    assert_same_way_round(seen[even] / 0.3, d[even], degrees=1)


def test_sources_are_not_distant_lights(stage, radiance):
    from pxr import UsdGeom, UsdLux

    sources, _ = split_sources(radiance)
    assert len(sources) == 2
    for number, source in enumerate(sources, 1):
        light = UsdLux.DistantLight(stage.GetPrimAtPath(f"/Light/Source{number}"))
        matrix = np.array(UsdGeom.Xformable(light).ComputeLocalToWorldTransform(0))
        shines = np.array([0, 0, -1, 0]) @ matrix  # along its own -Z
        np.testing.assert_allclose(shines[:3], -source.direction, atol=1e-5)
        np.testing.assert_allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3), atol=1e-6)
        assert np.linalg.det(matrix[:3, :3]) > 0
        assert light.GetNormalizeAttr().Get()
        assert light.GetAngleAttr().Get() == pytest.approx(2 * source.radius_deg, rel=1e-3)
        irradiance = np.array(light.GetColorAttr().Get()) * light.GetIntensityAttr().Get()
        np.testing.assert_allclose(irradiance, source.irradiance, rtol=1e-4)
    assert "_ambient" in dome_map(stage).path


def test_stage_says_which_way_is_up(stage):
    from pxr import UsdGeom

    assert UsdGeom.GetStageUpAxis(stage) == "Y"
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1
    assert stage.GetDefaultPrim().GetPath() == "/Light"


def test_package_is_aligned(radiance, tmp_path):
    import zipfile

    path = next(p for p in export(radiance, "usd", tmp_path) if p.suffix == ".usdz")
    with zipfile.ZipFile(path) as archive:
        entries = archive.infolist()
        assert entries[0].filename.endswith(".usda")
        data = path.read_bytes()
        for entry in entries:
            assert entry.compress_type == zipfile.ZIP_STORED
            at = entry.header_offset
            start = at + 30 + int.from_bytes(data[at + 26 : at + 28], "little")
            start += int.from_bytes(data[at + 28 : at + 30], "little")
            assert start % 64 == 0
        assert archive.testzip() is None
