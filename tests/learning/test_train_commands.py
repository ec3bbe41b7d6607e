"""The commands that train, evaluate and report: what is refused is one line and exit status 2, and writes nothing."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from support.folders import snapshot

torch = pytest.importorskip("torch", reason="needs ./train[torch]")
pytest.importorskip("onnx", reason="needs ./train[torch]")

from anyprobe_train.light import light_run  # noqa: E402
from anyprobe_train.light.light_run import LightRunConfig  # noqa: E402
from anyprobe_train.train.checkpoint import save_checkpoint  # noqa: E402
from anyprobe_train.world.batch import World  # noqa: E402

FILES = SimpleNamespace(files=SimpleNamespace(paths=()))
TEST_ASSETS = ("--hdri", "h", "--meshes", "m")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("run", "light", "--data", "d", "--device", "gpu"), "--device gpu: expected one of cpu"),
        (("run", "light", "--steps", "9", "--dry-run", "2"), "--steps and --dry-run: "),
        (("run",), "--data: expected a folder with hdri and meshes, got none"),
        (("run", "ligt"), 'Did you mean "light"?'),
        (("run", "mask"), "--data: expected a folder with hdri and meshes, got none"),
        (("run", "mask", "--device", "cuda"), "--device cuda: expected cpu"),
        (("run", "paper", "--steps", "9"), "--steps and --init-weights: expected neither with the run paper"),
        (("export", "o", "paper"), "anyprobe-train paper --graphs FOLDER"),
        (("paper", "--setting", "smal"), "expected one of full, quarter, short, small, tiny, got 'smal'"),
        (("paper", "--only", "hdr_nets"), "did you mean hdr_net?"),
        (("paper", "--figure", "3"), "expected one of 6, 7, 10, 11, 12, 13, 14, 15, 16, got 3"),
        (("export", "o", "mask"), "no such checkpoint; train first"),
        (("export", "o", "light"), "no such checkpoint; train first"),
        (("evaluate", *TEST_ASSETS, "--frozen", "--seed", "5"), "--seed 5: expected pairs drawn at random"),
        (("evaluate", *TEST_ASSETS, "--frozen", "--pairs", "2000"), "--pairs 2000: expected at most 1000"),
    ],
)
def test_what_is_refused_is_one_line(work, command, arguments, words):
    before = snapshot(work)
    assert words in command(*arguments).complaint
    assert snapshot(work) == before


def test_a_run_is_not_kept_in_its_own_place(work, command):
    """It would lose what its next step needs."""
    path = work / "runs" / "light" / "checkpoint.pt"
    save_checkpoint(path, LightRunConfig(), 3, {}, {"net": {"weight": torch.zeros(2)}})
    before = snapshot(work)
    assert "got the run's own checkpoint" in command("export", "o", "--keep", "runs/light/checkpoint.pt").complaint
    assert snapshot(work) == before


def test_a_dry_run_begins_anew_each_time(work, command, monkeypatch):
    monkeypatch.setattr(light_run, "run_light", lambda config, *, runs, **given: runs / config.name / "checkpoint.pt")
    monkeypatch.setattr(World, "open", lambda *_: SimpleNamespace(maps=SimpleNamespace(names=()), views=FILES))
    path = work / "runs" / "light-dry" / "checkpoint.pt"
    path.parent.mkdir(parents=True)
    path.write_bytes(b"of another machine")
    for name in ("hdri", "meshes"):
        (work / "data" / name).mkdir(parents=True)
    assert command("run", "--data", "data", "--dry-run", "2").status == 0
    assert not path.exists()
