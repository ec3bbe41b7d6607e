"""Wrong inputs on the page: the browser's package gives Python's codes, and the page names its own controls."""

from __future__ import annotations

import base64
import io
import json
import os
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image, UnidentifiedImageError
from support.wrong_inputs import TABLE, Wrong

import anyprobe
from anyprobe.inputs.hints import HINTS

WEB = Path(__file__).parents[2] / "web"
SERVER_ALONE = (
    *(name for name, wrong in TABLE.items() if any(key not in HINTS or not HINTS[key].in_web for key in wrong.given)),
    *("square panorama", "transparent panorama", "text as panorama"),  # the browser's package takes none
    *("a box as sphere", "mask of another size", "photo of a few pixels"),  # it scales masks and photos
    *("box of nothing", "box of all"),  # its networks judge these
)
"""Inputs that the page can have wrong at its server alone."""
pytestmark = pytest.mark.ci
IN_BROWSER = tuple(name for name in TABLE if name not in SERVER_ALONE)


def test_most_of_what_the_browser_takes_is_in_the_table():
    assert len(IN_BROWSER) >= 23


def test_the_page_says_each_in_its_words(tmp_path):
    if shutil.which("node") is None or not (WEB / "node_modules").is_dir():
        pytest.skip("needs Node.js and the packages of web/ (cd web && npm ci)")
    pytest.importorskip("starlette", reason="needs the serve extra")
    cases = {name: case(wrong, name in IN_BROWSER) for name, wrong in TABLE.items()}
    (tmp_path / "wrong.json").write_text(json.dumps(cases), encoding="utf-8")
    ended = subprocess.run(
        ["node", "--test", "test/wrongInputs.test.js"],
        cwd=WEB,
        env={**os.environ, "WRONG_INPUTS": str(tmp_path / "wrong.json")},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert ended.returncode == 0, ended.stdout[-4000:]
    assert f"# pass {len(TABLE) + len(IN_BROWSER)}\n" in ended.stdout
    assert "# skipped 0" in ended.stdout


def case(wrong: Wrong, in_browser: bool) -> dict[str, Any]:
    """One input as the browser has it, what Python says of it, and the server's answer."""
    from anyprobe.serve.answers import problem

    with pytest.raises(anyprobe.AnyprobeError) as error:
        anyprobe.estimate(wrong.photo, **wrong.given)
    found: dict[str, Any] = {"problem": json.loads(problem(422, error.value.notice).body)}
    if in_browser:
        found["browser"] = {
            "photo": picture(wrong.photo),
            "options": options(wrong.given),
            "code": wrong.code,
            "subject": [HINTS[name].in_web if name in HINTS else name for name in wrong.subject],
            "remedy": [one for one in wrong.remedy if one in HINTS],
        }
    return found


def picture(data: bytes) -> dict[str, Any]:
    """Pixels, or the bytes of what is no picture."""
    try:
        with Image.open(io.BytesIO(data)) as image:
            rgba = image.convert("RGBA")
    except UnidentifiedImageError:
        return {"bytes": base64.b64encode(data).decode()}
    return {"width": rgba.width, "height": rgba.height, "rgba": base64.b64encode(rgba.tobytes()).decode()}


def options(given: dict[str, Any]) -> dict[str, Any]:
    """Hints as the browser's package names and takes them; pictures as picture gives them, normals as numbers."""
    found: dict[str, Any] = {}
    for name, value in given.items():
        own = HINTS[name].in_web if name in HINTS else name
        if own == "material":
            part = "name" if name == "material" else name
            found.setdefault(own, {})[part] = value
        elif name == "normals":
            with Image.open(io.BytesIO(value)) as image:
                found[own] = (np.asarray(image.convert("RGB"), np.float32) / 255).ravel().round(3).tolist()
        else:
            found[own] = picture(value) if isinstance(value, bytes) else value
    return found
