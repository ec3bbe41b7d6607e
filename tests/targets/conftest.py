"""Programs that exports are proved in; a test skips with the reason where one cannot run."""

from __future__ import annotations

import pytest
from support.browser import FOLDER, NODE_MODULES, NoBrowser, find_browser, serve
from support.mitsuba_scenes import NoMitsuba, open_mitsuba


@pytest.fixture(scope="session")
def mi():
    """The module `mitsuba`."""
    try:
        return open_mitsuba()
    except NoMitsuba as reason:
        pytest.skip(str(reason))


@pytest.fixture
def site(tmp_path):
    """URL of a server of tmp_path under /export/, three.js under /node_modules/, and our test pages."""
    try:
        find_browser()
    except NoBrowser as reason:
        pytest.skip(str(reason))
    with serve({"/": FOLDER, "/export/": tmp_path, "/node_modules/": NODE_MODULES}) as url:
        yield url
