"""Assets that are left out, to choose by."""

from pathlib import Path
from types import SimpleNamespace

import pytest

from anyprobe.errors import InputError
from anyprobe_train.dataset.asset_store import AssetStore
from research import left_out


def test_what_is_left_out_is_what_no_run_learns_from(monkeypatch):
    def assets(names):
        return [SimpleNamespace(id=name, lifted=name == "d") for name in names]

    made = {True: assets("ab"), False: assets("abcd")}
    monkeypatch.setattr(
        left_out, "load_asset_store", lambda data, split, commercial_only: AssetStore(*2 * [made[commercial_only]])
    )
    left = left_out.load_left_out(Path("data"))
    assert (list(left.maps), list(left.shapes)) == (["c"], ["c", "d"])  # d: its lights are made up
    made[False] = made[True]
    with pytest.raises(InputError, match="0 maps and 0 shapes"):
        left_out.load_left_out(Path("data"))
