"""The page's own code gives what the package gives, for one photo: in Node, with the page's runtime."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from support.parity_case import write_parity_case

from anyprobe.estimate.estimator import Estimator

ROOT = Path(__file__).parents[2]
WEB = ROOT / "web"
pytestmark = pytest.mark.ci


def test_page_gives_what_the_package_gives(tmp_path):
    if shutil.which("node") is None or not (WEB / "node_modules" / "onnxruntime-web").is_dir():
        pytest.skip("needs Node.js and the packages of web/ (cd web && npm ci)")
    with Image.open(ROOT / "examples" / "vase.png") as image:
        photo = np.asarray(image.convert("RGBA"))
    off_centre = np.ascontiguousarray(photo[60:440, 60:])
    write_parity_case(tmp_path, Estimator(), off_centre, long_fov_deg=50.0)
    ended = subprocess.run(
        ["node", "--test", "test/parity.test.js"],
        cwd=WEB,
        env={**os.environ, "PARITY": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert ended.returncode == 0, ended.stdout[-3000:]
    assert "# skipped 0" in ended.stdout
    passed = re.search(r"^# pass (\d+)$", ended.stdout, re.MULTILINE)
    assert passed is not None
    assert int(passed[1]) >= 12
