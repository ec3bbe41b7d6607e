"""The command line of training in this process."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import pytest

from anyprobe_train.cli.app import main


@pytest.fixture
def command(command) -> Callable:
    """anyprobe-train's entry point; see tests/conftest.py."""
    return partial(command, main=main)
