"""Mitsuba for the tests that need it."""

from __future__ import annotations

import pytest
from support.mitsuba_scenes import NoMitsuba, open_mitsuba


@pytest.fixture(scope="session")
def mi():
    """The module `mitsuba`, our plugins registered; skips with the reason where it cannot run."""
    try:
        return open_mitsuba()
    except NoMitsuba as reason:
        pytest.skip(str(reason))
