"""What is given of the object, the camera and the light means the same in Python, on the command line, over HTTP and in
JavaScript, and comes from one place."""

from __future__ import annotations

import ast
import importlib.util
import inspect
import json
import re
from dataclasses import fields
from pathlib import Path
from typing import get_type_hints

import numpy as np
import pytest
from support.refused import refused

import anyprobe
from anyprobe.cli.app import app
from anyprobe.core.contract import contract
from anyprobe.errors import InputError
from anyprobe.estimate.estimator import Estimator, Settings, estimate
from anyprobe.estimate.photo import load_photo
from anyprobe.inputs.hints import HINTS, HintKeywords, Hints
from anyprobe.inputs.settings import SETTINGS, SettingKeywords
from anyprobe.relight.ground_view import view_of

ROOT = Path(__file__).parents[2]


def interface(name: str) -> set[str]:
    """Keys of an interface of the JavaScript package, with those of the interfaces that it extends."""
    types = ROOT / "web" / "types"
    text = "\n".join((types / file).read_text(encoding="utf-8") for file in ("index.d.ts", "inputs.d.ts"))
    parents, body = re.search(rf"export interface {name}(?: extends ([\w, ]+))? \{{(.*?)\n\}}", text, re.S).groups()
    own = set(re.findall(r"^  (\w+)\??:", body, re.M))
    return own.union(*(interface(parent.strip()) for parent in (parents or "").split(",") if parent))


# One place


SIGNATURES = {
    "estimate": (estimate, (Hints, Settings)),
    "Estimator()": (Estimator.__call__, (Hints,)),
    "load_photo": (load_photo, (Hints,)),
    "Estimator": (Estimator.__init__, (Settings,)),
}


@pytest.mark.parametrize("name", SIGNATURES)
def test_keywords_are_the_fields(name):
    """They are written out, with the fields' types and defaults."""
    function, kinds = SIGNATURES[name]
    keywords = inspect.signature(function).parameters
    for one in (one for kind in kinds for one in fields(kind)):
        assert (keywords[one.name].annotation, keywords[one.name].default) == (one.type, one.default)


def test_typed_keywords_are_the_fields():
    for keywords, kind in ((HintKeywords, Hints), (SettingKeywords, Settings)):
        plain = get_type_hints(kind)
        assert get_type_hints(keywords) == plain
        assert list(keywords.__annotations__) == list(plain)


def test_files_of_other_doors_are_fresh():
    """python integrations/write_inputs.py"""
    name = "write_inputs"
    spec = importlib.util.spec_from_file_location(name, ROOT / "integrations" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert [path.name for path, text in module.files().items() if path.read_text(encoding="utf-8") != text] == []
    jsonschema = pytest.importorskip("jsonschema")
    schema = json.loads((ROOT / "src" / "anyprobe" / "inputs" / "inputs.schema.json").read_text(encoding="utf-8"))
    check = jsonschema.Draft202012Validator(schema)
    assert check.is_valid({"fov_deg": 50, "click": [[1, 2], [3, 4]], "normals": "sphere"})
    assert not check.is_valid({"fov_deg": 500})
    assert not check.is_valid({"fov": 50})
    bounds = {name: schema["properties"]["fov_deg"][name] for name in ("minimum", "maximum")}
    assert list(bounds.values()) == [contract("lens")["least_fov_deg"], contract("lens")["most_fov_deg"]]
    assert list(schema["properties"]) == [*HINTS, *SETTINGS]


@pytest.mark.parametrize("kind", [Hints, Settings])
def test_every_field_is_described(kind):
    described = inspect.getdoc(kind).partition("Attributes:")[2].partition("Raises:")[0]
    names = {name.strip() for line in re.findall(r"^ {4}([\w, ]+):", described, re.M) for name in line.split(",")}
    names |= set(re.findall(r"; (near), (far):", described)[0]) if kind is Hints else set()
    assert names == {one.name for one in fields(kind)}


@pytest.mark.parametrize("command", ["estimate", "relight", "video"])
def test_every_hint_is_an_option(command):
    options = {name for one in app[command].assemble_argument_collection() for name in one.names}
    assert {f"--{hint.name}" for hint in HINTS.values()} <= options


def test_every_hint_is_described_over_http():
    pytest.importorskip("fastapi", reason="needs the serve extra")
    from anyprobe.serve.forms import EstimateForm

    carried = {hint.name for hint in HINTS.values()}
    assert carried <= set(EstimateForm.model_fields)
    assert [name for name in carried if not EstimateForm.model_fields[name].description] == []  # the reference's words


def test_javascript_takes_the_same_hints():
    """What it does not take yet is under no name of its own there; albedo and roughness stand within the material."""
    named = {name: hint.in_web for name, hint in HINTS.items()}
    options = interface("EstimateOptions")
    assert {name for name in named.values() if name} <= options
    assert {name for name, option in named.items() if not option} == {"depth", "near", "far", "roll_deg", "sun"}
    assert {"depth", "near", "far"} & options == set()
    text = (ROOT / "web" / "types" / "index.d.ts").read_text(encoding="utf-8")
    assert re.search(
        r"type GivenMaterial =[^;]*\{ name\?: MaterialName; albedo\?: [^;]+; roughness\?: number \};", text
    )


# Texts


@pytest.mark.parametrize("text", ["1", "1,2,3", "a,b", "nan,1", "inf,1", "1e9,1", ""])
def test_what_is_no_pair_of_numbers_is_refused(text):
    with refused("click", naming="120,90") as error:
        HINTS["click"].read(text)
    assert error.value.subject == ("click",)


def test_texts_are_read_as_what_they_mean():
    assert HINTS["box"].read("1,2,3,4.5") == (1.0, 2.0, 3.0, 4.5)
    assert HINTS["fov_deg"].read("40") == 40.0
    assert HINTS["albedo"].read("0.18") == (0.18,)
    assert HINTS["material"].read("gold") == "gold"
    assert HINTS["normals"].read_path("sphere") == "sphere"
    assert HINTS["normals"].read_path("n.png") == Path("n.png")
    with pytest.raises(InputError) as error:
        HINTS["normals"].read_word("n.png")
    assert error.value.subject == ("normals",)


# What does not go together


@pytest.mark.ci
def test_the_library_names_no_option():
    """Its lines are read in Python and by HTTP clients too."""
    source = Path(anyprobe.__file__).parent
    options = re.compile(rf"--({'|'.join(hint.name for hint in HINTS.values())})\b")
    found = [
        f"{path.relative_to(source)}: {node.value}"
        for path in sorted(source.rglob("*.py"))
        if path.parent.name != "cli"
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and options.search(node.value)
    ]
    assert found == []


def test_box_and_clicks_go_together():
    assert dict(Hints(box=(1, 2, 3, 4), click=[(2, 3)], exclude=(9, 9)).given()).keys() == {"box", "click", "exclude"}


# The front door


def test_a_photo_that_is_loaded_already_is_taken(estimator, photo_rgba):
    photo = load_photo(photo_rgba, fov_deg=50.0)
    expected = estimator(photo_rgba, fov_deg=50.0, material="plastic")
    for light in (
        estimator(photo, material="plastic"),
        estimator(load_photo(photo_rgba, fov_deg=50.0, material="plastic")),
    ):
        np.testing.assert_array_equal(light.radiance, expected.radiance)
    np.testing.assert_array_equal(anyprobe.estimate(photo).radiance, estimator(photo).radiance)


def test_a_photo_that_is_loaded_already_takes_no_other_hints(estimator, photo_rgba):
    with pytest.raises(InputError) as error:
        estimator(load_photo(photo_rgba), click=(3, 3), fov_deg=40.0)
    assert error.value.subject == ("click", "fov_deg")


def test_hints_may_come_as_one_and_keywords_count_before_them(estimator, photo_rgba):
    photo = load_photo(photo_rgba, Hints(fov_deg=50.0, pitch_deg=10.0), fov_deg=40.0)
    assert (photo.long_fov_deg, photo.pitch_deg) == (40.0, 10.0)


@pytest.mark.parametrize("call", [load_photo, estimate, Estimator])
def test_an_unknown_keyword_is_refused(call, photo_rgba):
    with pytest.raises(TypeError, match="masc"):
        call(photo_rgba if call is not Estimator else "lift", masc=1)


def test_other_settings_share_the_networks(estimator):
    other = estimator.with_settings(segmenter="small")
    assert other.models._sessions is estimator.models._sessions
    assert estimator.with_settings(model="paper").models.name == "paper"


# The camera's pitch


def test_the_photo_s_pitch_is_the_ground_s(photo_rgba):
    view, pitch_deg = view_of(load_photo(photo_rgba, pitch_deg=30.0))
    assert pitch_deg == 30.0
    np.testing.assert_allclose(view.up, [0.0, np.cos(np.pi / 6), 0.5])
    assert view_of(load_photo(photo_rgba, pitch_deg=30.0), 40.0)[1] == 40.0


def test_keywords_of_python_say_what_they_want():
    with refused("fov_deg", naming="str '50'") as error:
        Hints(fov_deg="50")
    assert error.value.subject == ("fov_deg",)
    for threads in (-1, "2", 1.5):
        with refused("threads", naming=f"got {threads!r}"):
            anyprobe.Estimator(threads=threads)
