"""Wrong inputs: the same code through every door, and each door's own words for the arguments that the notice names.

The page's are in tests/page/test_wrong_inputs.py.
"""

from __future__ import annotations

import json

import pytest
from support.wrong_inputs import TABLE, text_of

import anyprobe
from anyprobe.cli.options import OPTIONS
from anyprobe.inputs.hints import HINTS
from anyprobe.notices import PYTHON


@pytest.mark.parametrize("name", TABLE)
def test_python(name):
    wrong = TABLE[name]
    with pytest.raises(anyprobe.AnyprobeError) as error:
        anyprobe.estimate(wrong.photo, **wrong.given)
    notice = error.value.notice
    assert (notice.code, notice.subject, tuple(one.name for one in notice.remedy)) == (
        wrong.code,
        wrong.subject,
        wrong.remedy,
    )
    assert str(error.value) == PYTHON.line(notice)
    assert "--" not in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", [name for name, wrong in TABLE.items() if "command line" in wrong.doors])
def test_command_line(name, work, command):
    wrong, options = TABLE[name], []
    (work / "photo.png").write_bytes(wrong.photo)
    for key, value in wrong.given.items():
        if isinstance(value, bytes):
            (work / f"{key}.png").write_bytes(value)
            value = f"{key}.png"
        options += [OPTIONS.name(key), text_of(value)]
    ended = command("estimate", "photo.png", "--json", *options)
    assert ended.status == 2
    assert len(ended.err.splitlines()) == 1
    for key in wrong.subject:
        assert OPTIONS.name(key) in ended.err
    for key in wrong.remedy:
        assert (OPTIONS.name(key) if key in HINTS else OPTIONS.action(key)) in ended.err
    if ended.out:  # else the options themselves are at fault
        assert json.loads(ended.out)["code"] == wrong.code
    assert not any(f"{key}=" in ended.err for key in HINTS)
    assert not (work / "light").exists()


@pytest.fixture(scope="module")
def client(estimator):
    testclient = pytest.importorskip("fastapi.testclient", reason="needs the serve extra", exc_type=ImportError)
    pytest.importorskip("python_multipart", reason="needs the serve extra")
    from anyprobe.serve.api import create_app

    with testclient.TestClient(create_app(estimator)) as client:
        yield client


@pytest.mark.ci
@pytest.mark.parametrize("name", [name for name, wrong in TABLE.items() if "http" in wrong.doors])
def test_http(name, client):
    from anyprobe.serve.answers import FIELDS, PROBLEM

    wrong = TABLE[name]
    files = {"photo": ("photo.png", wrong.photo)}
    files |= {key: (f"{key}.png", value) for key, value in wrong.given.items() if isinstance(value, bytes)}
    texts = {FIELDS.name(key): text_of(value) for key, value in wrong.given.items() if not isinstance(value, bytes)}
    answer = client.post("/v1/estimate", files=files, data=texts)
    body = answer.json()
    assert (answer.status_code, answer.headers["content-type"]) == (422, PROBLEM)
    assert (body["code"], body["status"]) == (wrong.code, 422)
    assert body.get("subject", []) == [FIELDS.name(key) for key in wrong.subject]
    assert [one["name"] for one in body.get("remedy", [])] == [FIELDS.name(key) for key in wrong.remedy]
    for key in wrong.subject:
        assert FIELDS.name(key) in body["detail"]
    assert "--" not in body["detail"]
    assert not any(f"{key}=" in body["detail"] for key in HINTS)
