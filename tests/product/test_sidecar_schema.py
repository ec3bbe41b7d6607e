"""The JSON Schema of the sidecar holds for what is written, and knows every key."""

from __future__ import annotations

import json
from dataclasses import fields
from importlib import resources

import numpy as np
import pytest
from support.scenes import sphere_photo

import anyprobe
from anyprobe.core.frames import rotation_y
from anyprobe.estimate.result import Light
from anyprobe.estimate.sidecar import OF_THE_MAP, SIDECAR_VERSION, Origin

jsonschema = pytest.importorskip("jsonschema")
pytestmark = pytest.mark.usefixtures("networks_opened_once")


@pytest.fixture(scope="module")
def schema():
    return json.loads((resources.files("anyprobe") / "estimate" / "sidecar.schema.json").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def light():
    photo = sphere_photo((64, 48))
    return anyprobe.estimate(photo, material="porcelain", pitch_deg=10.0, normals="sphere")


def test_what_lights_write_is_what_the_schema_says(schema, light, tmp_path):
    jsonschema.Draft202012Validator.check_schema(schema)
    turned, bare = light.rotate(rotation_y(0.5)), Light(radiance=np.ones((64, 128, 3), np.float32))
    for number, one in enumerate((light, turned, bare)):
        said = json.loads(one.save(tmp_path / f"{number}.json").read_text(encoding="utf-8"))
        jsonschema.validate(said, schema)
        for name in ("", "ground", "dominant_light", "mask", "crop", "object", "uncertainty"):
            entry, described = (said[name], schema["properties"][name]) if name in said else (said, schema)
            described = described if "properties" in described else described["anyOf"][0]
            assert set(entry) <= set(described["properties"]), name


def test_the_schema_has_the_keys_that_are_written_and_no_other(schema):
    properties = schema["properties"]
    origin, arrays = {one.name for one in fields(Origin)} - {"more"}, {"radiance", "stages"}
    assert set(properties) == origin | set(OF_THE_MAP) - arrays
    assert properties["version"] == {"const": SIDECAR_VERSION}


@pytest.mark.parametrize(
    ("key", "value"), [("sh9", [[0, 0, 0]]), ("version", 1), ("confidence", 2), ("frame", None), ("warnings", "none")]
)
def test_another_value_is_refused(schema, light, key, value):
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(light.sidecar() | {key: value}, schema)
