"""What is given of the object, the camera and the light means the same in Python, on the command line, over HTTP and in
JavaScript, and comes from one place."""

from __future__ import annotations

import ast
import inspect
import json
import re
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
import typer
from PIL import Image

import anyprobe
from anyprobe.cli.app import app
from anyprobe.cli.options import line_of
from anyprobe.errors import InputError
from anyprobe.estimate.estimator import Estimator, Settings, SettingsDict, estimate
from anyprobe.estimate.photo import load_photo
from anyprobe.hints import HINTS, Hints, HintsDict, renamed
from anyprobe.relight.ground_view import view_of

ROOT = Path(__file__).parents[2]


def interface(name: str) -> set[str]:
    """Keys of an interface of the JavaScript package, with those of the interfaces that it extends."""
    text = (ROOT / "web" / "types" / "index.d.ts").read_text(encoding="utf-8")
    parents, body = re.search(rf"export interface {name}(?: extends ([\w, ]+))? \{{(.*?)\n\}}", text, re.S).groups()
    own = set(re.findall(r"^  (\w+)\??:", body, re.M))
    return own.union(*(interface(parent.strip()) for parent in (parents or "").split(",") if parent))


# One place


@pytest.mark.parametrize(("kind", "keywords"), [(Hints, HintsDict), (Settings, SettingsDict)])
def test_keywords_are_the_fields(kind, keywords):
    types = {name: one.__forward_arg__ for name, one in keywords.__annotations__.items()}
    assert types == {one.name: one.type for one in fields(kind)}


@pytest.mark.parametrize("kind", [Hints, Settings])
def test_every_field_is_described(kind):
    described = inspect.getdoc(kind).partition("Attributes:")[2].partition("Raises:")[0]
    names = {name.strip() for line in re.findall(r"^ {4}([\w, ]+):", described, re.M) for name in line.split(",")}
    names |= set(re.findall(r"; (near), (far):", described)[0]) if kind is Hints else set()
    assert names == {one.name for one in fields(kind)}


def test_help_shows_what_estimate_takes():
    shown = list(inspect.signature(estimate).parameters)
    assert shown == ["source", "hints", *HINTS, *(one.name for one in fields(Settings))]
    assert "more" in inspect.getdoc(estimate)


@pytest.mark.parametrize("command", ["estimate", "relight", "video"])
def test_every_hint_is_an_option(command):
    options = {name for one in typer.main.get_command(app).commands[command].params for name in one.opts}
    assert {f"--{hint.name}" for hint in HINTS.values()} <= options


def test_every_hint_is_described_over_http():
    pytest.importorskip("fastapi", reason="needs the serve extra")
    from anyprobe.serve import openapi

    carried = {hint.name for hint in HINTS.values()}
    assert carried <= set(openapi.form_names(openapi.ESTIMATE_ROUTE))
    page = (ROOT / "docs" / "how-to" / "serve.md").read_text(encoding="utf-8")
    assert {name for name in carried if f"`{name}`" not in page} == set()


def test_javascript_takes_the_same_hints():
    """What it does not take yet is under no name of its own there; albedo and roughness stand within the material."""
    named = {name: hint.in_web for name, hint in HINTS.items()}
    options = interface("EstimateOptions")
    assert {name for name in named.values() if name} <= options
    assert {name for name, option in named.items() if not option} == {"depth", "near", "far", "roll_deg"}
    assert {"depth", "near", "far"} & options == set()
    text = (ROOT / "web" / "types" / "index.d.ts").read_text(encoding="utf-8")
    assert re.search(
        r"type GivenMaterial =[^;]*\{ name\?: MaterialName; albedo\?: [^;]+; roughness\?: number \};", text
    )


# Texts


@pytest.mark.parametrize("text", ["1", "1,2,3", "a,b", "nan,1", "inf,1", "1e9,1", ""])
def test_what_is_no_pair_of_numbers_is_refused(text):
    with pytest.raises(InputError, match=r"^click: expected X,Y in pixels, got .*; for instance 120,90$"):
        HINTS["click"].read(text)


def test_texts_are_read_as_what_they_mean():
    assert HINTS["box"].read("1,2,3,4.5") == (1.0, 2.0, 3.0, 4.5)
    assert HINTS["fov_deg"].read("40") == 40.0
    assert HINTS["albedo"].read("0.18") == (0.18,)
    assert HINTS["material"].read("gold") == "gold"
    assert HINTS["normals"].read_path("sphere") == "sphere"
    assert HINTS["normals"].read_path("n.png") == Path("n.png")
    with pytest.raises(InputError, match="^normals: expected a file part or sphere, got 'n.png'$"):
        HINTS["normals"].read_word("n.png")


# What does not go together

TOGETHER = [
    ({"mask": "m.png", "box": (1, 2, 90, 90)}, "mask and box: expected one of them"),
    ({"depth": "d.npy", "near": 1.0, "click": (3, 3)}, "depth and click: expected one of them"),
    ({"mask": "m.png", "exclude": (3, 3)}, "exclude: expected click, box or neither with it, got mask"),
    ({"far": 3.0}, "far: expected depth with it"),
    ({"fov_deg": float("nan")}, "fov_deg: expected a field of view"),
    ({"pitch_deg": 91.0}, "pitch_deg: expected -90 to 90 degrees"),
    ({"material": "gold", "albedo": 0.5}, "albedo: expected a material that has one"),
]


@pytest.mark.parametrize(("given", "line"), TOGETHER)
def test_what_does_not_go_together_is_refused_before_anything_is_read(given, line):
    with pytest.raises(InputError, match=f"^{re.escape(line)}") as error:
        load_photo("absent.png", **given)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (("--mask", "m.png", "--click", "3,3"), "--mask and --click: expected one of them, got both"),
        (("--fov", "0"), "--fov: expected a field of view"),
        (("--pitch", "91"), "--pitch: expected -90 to 90 degrees"),
    ],
)
def test_the_command_line_names_its_options(work, command, options, line):
    Image.new("L", (8, 8)).save("m.png")
    assert command("estimate", "absent.png", *options).complaint.startswith(f"anyprobe: {line}")


def test_a_line_names_what_its_reader_can_give():
    """A file's name is none of ours."""
    line = "a.png: pass click= on it, or box=, or (mask=); mask=3.png stays; roughness="
    assert line_of("b.jpg: pass box=130,100.5,325,385") == "b.jpg: pass --box 130,100.5,325,385"
    assert line_of(f"{line}\n") == (
        "a.png: pass --click X,Y on it, or --box X0,Y0,X1,Y1, or (--mask FILE); mask=3.png stays; --roughness NUMBER"
    )
    assert (
        renamed(line, lambda hint: hint.name)
        == "a.png: pass click on it, or box, or (mask); mask=3.png stays; roughness"
    )


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
    with pytest.raises(InputError, match="^click and fov_deg: expected with a picture, .* give it to load_photo$"):
        estimator(load_photo(photo_rgba), click=(3, 3), fov_deg=40.0)


def test_hints_may_come_as_one_and_keywords_count_before_them(estimator, photo_rgba):
    photo = load_photo(photo_rgba, Hints(fov_deg=50.0, pitch_deg=10.0), fov_deg=40.0)
    assert (photo.long_fov_deg, photo.pitch_deg) == (40.0, 10.0)


@pytest.mark.parametrize("call", [load_photo, estimate, Estimator])
def test_an_unknown_keyword_is_refused(call, photo_rgba):
    with pytest.raises(TypeError, match="masc"):
        call(photo_rgba if call is not Estimator else "lift", masc=1)


def test_other_settings_share_the_networks(estimator):
    other = estimator.with_settings(emitters="expected", detail="plausible", size=64)
    assert other.models._run is estimator.models._run
    assert (other.settings.emitters, other.models.emitters, other.settings.size) == ("expected", "expected", 64)
    assert (estimator.settings.emitters, estimator.models.emitters) == ("mode", "mode")
    assert estimator.with_settings(model="paper").models.name == "paper"


# The camera's pitch


def test_the_photo_s_pitch_is_the_ground_s(photo_rgba):
    view, pitch_deg = view_of(load_photo(photo_rgba, pitch_deg=30.0))
    assert pitch_deg == 30.0
    np.testing.assert_allclose(view.up, [0.0, np.cos(np.pi / 6), 0.5])
    assert view_of(load_photo(photo_rgba, pitch_deg=30.0), 40.0)[1] == 40.0


def test_every_door_takes_the_pitch(work, command, estimator, photo_rgba):
    pytest.importorskip("fastapi", reason="needs the serve extra")
    from fastapi.testclient import TestClient

    from anyprobe.serve.api import create_app

    Image.fromarray(photo_rgba).save("photo.png")
    found = [estimator("photo.png", pitch_deg=25.0).sidecar()]
    found.append(json.loads(command("estimate", "photo.png", "--pitch", "25", "--json").out))
    with TestClient(create_app(estimator)) as client:
        data = Path("photo.png").read_bytes()
        found.append(client.post("/v1/estimate?pitch=25", content=data).json())
        found.append(client.post("/v1/estimate", files={"photo": data}, data={"pitch": "25"}).json())
    assert [one["pitch_deg"] for one in found] == [25.0] * 4
    assert "pitch_deg" not in estimator("photo.png").sidecar()


def test_metal_contradicts_a_material_that_is_none(work, command):
    Image.new("L", (8, 8)).save("m.png")
    complaint = command("estimate", "m.png", "--material", "matte", "--metal").complaint
    assert complaint == "anyprobe: --metal and --material matte: expected a metal, got another; leave one out"


def test_keywords_of_python_say_what_they_want():
    with pytest.raises(InputError, match="^fov_deg: expected a number, got str '50'$"):
        Hints(fov_deg="50")
    for name, like in (("fov", "fov_deg"), ("pitch", "pitch_deg"), ("marterial", "material")):
        with pytest.raises(TypeError, match=f"^{name}: expected one of the hints; did you mean {like}[?]$"):
            anyprobe.estimate(np.zeros((8, 8, 3), np.uint8), **{name: 1})
    with pytest.raises(InputError, match="^threads: expected 1 or more, got -1"):
        anyprobe.Estimator(threads=-1)
