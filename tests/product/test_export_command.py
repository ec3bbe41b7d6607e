"""anyprobe export and Light.export, from outside."""

from __future__ import annotations

import json

import numpy as np
import OpenEXR
import pytest
from support.two_phase import two_phase

from anyprobe.cli.export import target_names
from anyprobe.estimate.result import Light
from anyprobe.estimate.sidecar import Origin
from anyprobe.export.target_frames import BLENDER
from anyprobe.export.targets import TARGETS, export
from anyprobe.maps.radiance import read_radiance

UNVERIFIED = {"unity", "unreal", "webxr"}
"""Targets that no program here has shown."""


@pytest.fixture
def light_path(work):
    light = Light(radiance=two_phase(32), origin=Origin(photo="vase.png", model="paper-0"))
    light.save(work / "light" / "vase.json")
    return light.save(work / "light" / "vase.exr")


@pytest.mark.parametrize("target", TARGETS)
def test_target_writes_what_its_sidecar_lists(target, tmp_path):
    paths = export(two_phase(32), target, tmp_path / "out", "my vase")
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [path.name for path in paths]
    said = json.loads((tmp_path / "out" / f"my vase_{target}.json").read_text())
    assert said["files"] == [path.name for path in paths]
    assert said["target"] == target
    assert ("only: not" in said["checked"]) == (target in UNVERIFIED)
    assert said["scale"].startswith("relative")
    assert said["exposure_ev"] == 0
    assert len(said["sh"]["full"]) == len(said["sh"]["ambient"]) == 27
    assert said["primaryLightDirection"]["w"] == 0
    assert said["primaryLightIntensity"]["w"] == 1
    for path in paths:
        assert path.name.startswith(f"my vase_{target}") or path.suffix == ".cs"
        if path.suffix in (".py", ".js", ".html"):
            assert "@NAME@" not in path.read_text()
            assert f'"my vase_{target}"' in path.read_text()


@pytest.mark.parametrize("target", TARGETS)
def test_an_estimates_error_stands_beside_its_dominant_light(command, light_path, work, target):
    """By the command from the .json beside the map, by Light.export from the light; nothing else changes."""
    stated = json.loads(light_path.with_suffix(".json").read_text())["dominant_light"]["error_deg"]
    assert command("export", light_path, "--to", target, "-o", "out", "-q").status == 0
    Light(radiance=two_phase(32), origin=Origin(model="paper-0")).export(target, "own", "vase")
    export(two_phase(32), target, "plain", "vase")  # of no estimate
    for folder, error in (("out", stated), ("own", stated), ("plain", None)):
        said = json.loads((work / folder / f"vase_{target}.json").read_text())
        assert said["dominant_light"].get("error_deg") == error
        assert ("error_deg" in said["dominant_light"]) == (error is not None)
    line = f"     The direction is estimated: off by up to {stated} degrees in two of three cases\n"
    for path in (work / "own").iterdir():
        plain = (work / "plain" / path.name).read_bytes()
        if path.name == "vase_unreal.txt":
            assert path.read_text().replace(line, "").encode() == plain
            assert line in path.read_text()
        elif path.name != f"vase_{target}.json":
            assert path.read_bytes() == plain


def test_command_writes_all_targets(command, light_path, work):
    done = command("export", light_path, "--to", "all", "-o", "out", "--json")
    assert done.status == 0
    lines = [json.loads(line) for line in done.out.splitlines()]
    assert [line["target"] for line in lines] == list(TARGETS)
    assert sorted(name for line in lines for name in line["files"]) == sorted(
        str(path.relative_to(work)) for path in (work / "out").iterdir()
    )
    said = json.loads((work / "out" / "vase_three.json").read_text())
    assert said["origin"]["photo"] == "vase.png"
    assert said["origin"]["model"] == "paper-0"


@pytest.mark.parametrize(
    ("asked", "written"),
    [
        ("webxr, three", ["webxr", "three"]),
        ("usd,webxr,usd", ["usd", "webxr"]),
        ("all,webxr", list(TARGETS)),
        ("webxr , all", ["webxr", *(name for name in TARGETS if name != "webxr")]),
    ],
)
def test_list_of_targets(asked, written):
    assert target_names(asked) == written


def test_several_lights_have_a_folder_each(command, light_path, work):
    Light(radiance=two_phase(32)).save(work / "other" / "lamp.hdr")
    done = command("export", light_path, "other/lamp.hdr", "--to", "webxr,usd", "--json")
    assert done.status == 0, done.err
    said = [json.loads(line) for line in done.out.splitlines()]
    assert [(one["light"], one["target"]) for one in said] == [
        (str(light), target) for light in (light_path, "other/lamp.hdr") for target in ("webxr", "usd")
    ]
    assert sorted(path.name for path in (work / "export").iterdir()) == ["lamp", "vase"]
    assert (work / "export" / "vase" / "vase_webxr.json").exists()
    Light(radiance=two_phase(32)).save(work / "other" / "vase.hdr")
    refused = command("export", light_path, "other/vase.hdr", "--to", "webxr", "-o", "out")
    assert "expected distinct file names" in refused.complaint
    assert not (work / "out").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--to", "maya"), ("expected any of three, blender", "'maya'")),
        (("--to", ""), ("got an empty one",)),
        (("--to", "usd,,three"), ("expected any of three", "''")),
        (("--to", "all,maya"), ("expected any of three", "'maya'")),
        (("--to", "usd", "--world-from-camera", "1,2,3,4"), ("YAW,ELEVATION", "'1,2,3,4'")),
        (("--to", "usd", "--world-from-camera", "1,0,0,0,1,0,0,0,-1"), ("rotation", "mirrored")),
        (("--to", "usd", "--exposure", "99"), ("stops from -30 to 30",)),
        (("--to", "usd", "--exposure", "nan"), ("stops from -30 to 30",)),
    ],
)
def test_bad_options(command, light_path, work, arguments, words):
    complaint = command("export", light_path, *arguments).complaint
    for word in words:
        assert word in complaint
    assert not (work / "export").exists()


@pytest.mark.parametrize("name", ["vase_three.hdr", "vase_three_ambient.hdr"])
def test_map_that_is_an_export_already(command, light_path, work, name):
    assert command("export", light_path, "--to", "three", "-q").status == 0
    complaint = command("export", work / "export" / name, "--to", "usd").complaint
    assert "exported for three" in complaint


@pytest.mark.parametrize("target", ["blender", "usd"])
def test_exr_that_is_an_export_is_known_without_its_sidecar(command, light_path, work, target):
    assert command("export", light_path, "--to", target, "-q").status == 0
    (work / "export" / f"vase_{target}.json").unlink()
    complaint = command("export", work / "export" / f"vase_{target}.exr", "--to", "webxr").complaint
    assert "front in its centre" in complaint
    assert "u = 0.5 - atan2(" in complaint


def test_estimate_beside_an_export_of_its_name(command, light_path, work):
    """The header of the estimate's own map counts, not another file's .json."""
    assert command("export", light_path, "--to", "three", "-q").status == 0
    path = (work / "export" / "vase_three.json").with_suffix(".exr")
    path.write_bytes(light_path.read_bytes())
    assert command("export", path, "--to", "webxr", "-q").status == 0


@pytest.mark.parametrize(("exposure_ev", "kind"), [(-25.0, np.float32), (0.0, np.float16)])
def test_values_below_half_stay_in_exr(work, exposure_ev, kind):
    radiance = 0.01 + two_phase(32)
    radiance[20] = 0.0  # black is in every format
    for path in export(radiance, "blender", work, exposure_ev=exposure_ev):
        if path.suffix == ".exr" and "ambient" not in path.name:
            found = read_radiance(path)
            with OpenEXR.File(str(path)) as file:
                assert file.channels()["RGB"].pixels.dtype == kind
    expected = BLENDER.roll(radiance) * 2.0**exposure_ev
    np.testing.assert_allclose(found, expected, rtol=1e-3, atol=0)


@pytest.mark.parametrize(("stops", "is_said"), [(0, False), (18, True), (-30, True)])
def test_light_that_no_file_of_the_target_holds_is_said(command, light_path, stops, is_said):
    order = ("export", light_path, "--to", "ktx2,blender", "-o", "out", "--exposure", stops)
    plain, said = command(*order), command(*order, "--json")
    assert ("warning: ktx2: " in plain.err) == ("exceeds the range of its files" in plain.err) == is_said
    assert "warning: blender" not in plain.err
    ktx2, blender = (json.loads(line)["clipped_energy"] for line in said.out.splitlines())
    assert (ktx2 > 0.02) == is_said
    assert blender == 0


@pytest.mark.parametrize("brightest", [1e20, 1e38])
def test_a_map_too_bright_for_its_sums_is_refused(command, work, brightest):
    radiance = two_phase(32)
    radiance[3, 5] = brightest
    OpenEXR.File({}, {"RGB": radiance.astype(np.float32)}).write(str(work / "hot.exr"))
    done = command("export", "hot.exr", "--to", "all", "-o", "out")
    assert done.status == 2
    assert done.err.startswith("anyprobe: hot_three: expected radiance of at most 1e+12, got")
    assert not (work / "out").exists()
