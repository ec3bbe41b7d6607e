"""The ComfyUI nodes against their library, under a stand-in of ComfyUI's node API (support/comfy_stand_in.py)."""

from __future__ import annotations

import asyncio
import importlib.util
import json
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from support import comfy_stand_in
from support.scenes import sphere_photo

import anyprobe
from anyprobe.files.objects import OBJECTS
from anyprobe.relight.insert import Arrangement, Stage

torch = pytest.importorskip("torch", reason="the nodes' boundary is torch: pip install './train[torch]'")

pytestmark = pytest.mark.usefixtures("rough_shadows")

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "integrations" / "comfyui"
LOADED_AS = "custom_nodes_x_light_from_photo"
OF_COMFYUI = {
    "LoadImage": ({"image"}, ["IMAGE", "MASK"]),
    "PreviewImage": ({"images"}, []),
    "PreviewAny": ({"source"}, []),
}
"""ComfyUI's own nodes in the example: inputs, and types of outputs."""


@pytest.fixture
def nodes(monkeypatch, tmp_path):
    """The extension's nodes by id, loaded as ComfyUI loads a folder of custom_nodes."""
    comfy_stand_in.install(monkeypatch, tmp_path)
    spec = importlib.util.spec_from_file_location(LOADED_AS, FOLDER / "__init__.py")
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, LOADED_AS, module)
    spec.loader.exec_module(module)
    monkeypatch.setitem(sys.modules, f"{LOADED_AS}.nodes", sys.modules[f"{LOADED_AS}.nodes"])

    async def listed():
        return await (await module.comfy_entrypoint()).get_node_list()

    return {one.define_schema().node_id: one for one in asyncio.run(listed())}


@pytest.fixture
def photo():
    return tensor(sphere_photo()[..., :3])


@pytest.fixture
def mask():
    return tensor(sphere_photo()[..., 3])


def tensor(values: np.ndarray):
    """As Load Image gives a picture or a mask."""
    return torch.from_numpy(values.astype(np.float32) / 255.0)[None]


def light_of(**hints):
    photo = sphere_photo()
    return anyprobe.estimate(np.ascontiguousarray(photo[..., :3]), mask=photo[..., 3], **hints)


def test_schemas_hold_the_rules_of_the_api(nodes):
    assert set(nodes) == {"AnyprobeLightFromPhoto", "AnyprobeRelight", "AnyprobeSaveHDRI"}
    for one in nodes.values():
        one.define_schema().validate()


@pytest.mark.parametrize(
    ("given", "hints"),
    [
        ({}, {}),
        (
            {"fov": "50", "pitch": "0", "material": "porcelain", "surroundings": "none"},
            {"fov_deg": 50, "pitch_deg": 0, "material": "porcelain", "surroundings": "none"},
        ),
    ],
)
def test_light_is_that_of_the_library(nodes, photo, mask, given, hints):
    found = nodes["AnyprobeLightFromPhoto"].execute(photo=photo, mask=mask, **given)
    hdri, spheres, said = found.args
    expected = light_of(**hints)
    assert hdri.shape == (1, 64, 128, 3)
    assert hdri.dtype == torch.float32
    np.testing.assert_array_equal(hdri[0].numpy(), expected.radiance)
    assert spheres.shape == (1, 256, 768, 3)
    assert 0 <= spheres.min() < spheres.max() <= 1
    said, sidecar = json.loads(said), expected.sidecar()
    differ = {key for key in sidecar if key not in ("photo", "seconds") and said[key] != sidecar[key]}
    assert not [key for key in differ if key != "warnings"]  # which name the photo
    assert len(said["warnings"]) == len(sidecar["warnings"])


def test_clicks_and_boxes_reach_the_library(nodes, photo):
    found = nodes["AnyprobeLightFromPhoto"].execute(photo=photo, click="64,48; 60,40", box="30,14,98,82")
    rgb = np.ascontiguousarray(sphere_photo()[..., :3])
    expected = anyprobe.estimate(rgb, click=[(64, 48), (60, 40)], box=(30, 14, 98, 82))
    np.testing.assert_array_equal(found.args[0][0].numpy(), expected.radiance)


def test_each_photo_of_a_batch_has_its_own_light(nodes, photo, mask):
    dim = photo * 0.5
    hdri, spheres, said = nodes["AnyprobeLightFromPhoto"].execute(photo=torch.cat([photo, dim]), mask=mask).args
    assert hdri.shape[0] == spheres.shape[0] == len(json.loads(said)) == 2
    alone = nodes["AnyprobeLightFromPhoto"].execute(photo=dim, mask=mask).args[0]
    assert torch.equal(hdri[1], alone[0])
    assert not torch.equal(hdri[0], hdri[1])


def test_warnings_are_in_the_json_under_the_node_and_in_the_log(nodes, mask, caplog):
    clipped = torch.where(mask[..., None] > 0.5, 1.0, tensor(sphere_photo()[..., :3]))
    found = nodes["AnyprobeLightFromPhoto"].execute(photo=clipped, mask=mask)
    warnings = json.loads(found.args[2])["warnings"]
    assert warnings
    assert found.ui.value.splitlines() == warnings
    assert [one.message for one in caplog.records] == warnings


def test_inserted_object_is_that_of_the_library(nodes, photo, mask, monkeypatch):
    rgba = sphere_photo()
    one = anyprobe.load_photo(np.ascontiguousarray(rgba[..., :3]), mask=rgba[..., 3])
    light = anyprobe.estimate(one)
    stage = Stage(one, OBJECTS["block"](), Arrangement(size=0.4, at=(20, 80), ground=light.ground))
    given = {"shape": "block", "shape_material": "gold", "size": 0.4, "at": "20,80", "photo": photo, "mask": mask}
    shown = nodes["AnyprobeRelight"].execute(hdri=torch.from_numpy(light.radiance.copy())[None], **given).args[0]
    tolerance = {"atol": 0.02}  # Mitsuba's paths, where it is installed
    np.testing.assert_allclose(shown[0].numpy(), stage.relit(light.radiance, "gold"), **tolerance)
    assert np.abs(shown[0].numpy() - one.rgb).max() > 0.1
    monkeypatch.setattr(sys.modules[f"{LOADED_AS}.nodes"], "least_scale", lambda photo, radiance: 2.0)  # this photo: 1
    alone = nodes["AnyprobeRelight"].execute(**given).args[0]
    np.testing.assert_allclose(alone[0].numpy(), stage.relit(light.radiance * np.float32(2), "gold"), **tolerance)


def test_nothing_is_written_of_what_is_no_map_or_no_light(nodes, photo, tmp_path):
    save = nodes["AnyprobeSaveHDRI"].execute
    with pytest.raises(ValueError, match="expected width = 2 x height"):
        save(hdri=photo, filename_prefix="a", format="exr")
    for light in ("{", "[]", "[1]"):
        with pytest.raises(ValueError, match="light: expected the JSON"):
            save(hdri=torch.ones(1, 8, 16, 3), filename_prefix="a", format="exr", light=light)
    assert not list(tmp_path.iterdir())


def test_example_workflow_fits_the_nodes_and_runs(nodes, tmp_path):
    """Every input is known, every required one given, every link of the right type; and what it links runs."""
    workflow, values = json.loads((FOLDER / "workflow.json").read_text()), {}
    for number in sorted(workflow, key=int):  # links lead to smaller numbers
        kind, inputs = workflow[number]["class_type"], dict(workflow[number]["inputs"])
        if kind in OF_COMFYUI:
            assert set(inputs) == OF_COMFYUI[kind][0]
            if kind == "LoadImage":
                rgba = np.array(Image.open(ROOT / "examples" / inputs["image"]))
                values[number] = tensor(rgba[..., :3]), 1 - tensor(rgba[..., 3])
            continue
        schema = nodes[kind].define_schema()
        known = {one.id: one for one in schema.inputs}
        assert {one.id for one in schema.inputs if not one.optional} <= set(inputs) <= set(known)
        for name, value in inputs.items():
            if isinstance(value, list):
                source = workflow[value[0]]["class_type"]
                types = (
                    OF_COMFYUI[source][1]
                    if source in OF_COMFYUI
                    else [one.io_type for one in nodes[source].define_schema().outputs]
                )
                assert types[value[1]] == known[name].io_type
                inputs[name] = values[value[0]][value[1]]
            else:
                assert known[name].accepts(value)
        values[number] = nodes[kind].execute(**inputs).args
        assert len(values[number]) == len(schema.outputs)
    assert {path.suffix for path in tmp_path.rglob("*.*")} == {".exr", ".json"}
