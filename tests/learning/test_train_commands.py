"""The commands that train, evaluate and report: what is refused is one line and exit status 2, and writes nothing."""

from __future__ import annotations

import pytest
from support.folders import snapshot

torch = pytest.importorskip("torch", reason="needs ./train[torch]")
pytest.importorskip("onnx", reason="needs ./train[torch]")
pytest.importorskip("tensorboard", reason="needs ./train[torch]")

from anyprobe_train.train import loop  # noqa: E402
from anyprobe_train.train.checkpoint import save_checkpoint  # noqa: E402
from anyprobe_train.train.config import RUNS, smoke  # noqa: E402
from anyprobe_train.train.loop import make_learner  # noqa: E402

TEST_ASSETS = ("--hdri", "h", "--meshes", "m")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("run", "lift", "--device", "gpu"), "--device gpu: expected one of cpu, cuda"),
        (("run", "lift", "--steps", "9", "--dry-run", "2"), "--steps and --dry-run: "),
        (("run", "lft"), "did you mean lift?"),
        (("run", "mask"), "in a clone, with python -m anyprobe_train.mask_network"),
        (("run", "lift", "--init-weights", "none.pt"), "none.pt: no such file"),
        (("run", "paper", "--steps", "9"), "--steps and --init-weights: expected neither with the run paper"),
        (("export", "o", "paper"), "anyprobe-train paper --graphs FOLDER"),
        (("paper", "--setting", "smal"), "expected one of full, quarter, small, tiny, got 'smal'"),
        (("paper", "--only", "hdr_nets"), "did you mean hdr_net?"),
        (("paper", "--figure", "3"), "expected one of 6, 7, 10, 11, 12, 13, 14, 15, 16, got 3"),
        (("export", "o", "mask"), "in a clone, with python -m anyprobe_train.mask_network"),
        (("export", "o", "lift"), "no such checkpoint; train first"),
        (("evaluate", *TEST_ASSETS, "--frozen", "--seed", "5"), "--seed 5: expected pairs drawn at random"),
        (("evaluate", *TEST_ASSETS, "--frozen", "--pairs", "2000"), "--pairs 2000: expected at most 1000"),
    ],
)
def test_what_is_refused_is_one_line(work, command, arguments, words):
    before = snapshot(work)
    assert words in command(*arguments).complaint
    assert snapshot(work) == before


def write_run(work, name):
    config = smoke(RUNS[name](), 3)
    nets = make_learner(config, "cpu").nets
    path = work / "runs" / name / "checkpoint.pt"
    optimizer = torch.optim.AdamW(nets.parameters())
    state = {"nets": nets.state_dict(), "optimizer": optimizer.state_dict(), "pairs": 12}
    save_checkpoint(path, config, 3, {}, state)
    return path


def test_a_run_is_not_kept_in_its_own_place(work, command):
    """It would lose what its next step needs."""
    for name, arguments in (("normals", ("o", "normals", "--keep", "runs/normals/checkpoint.pt")),):
        write_run(work, name)
        before = snapshot(work)
        assert "got the run's own checkpoint" in command("export", *arguments).complaint
        assert snapshot(work) == before


def test_a_dry_run_begins_anew_each_time(work, command, monkeypatch):
    monkeypatch.setattr(loop, "train", lambda config, *, runs, **given: runs / config.name / "checkpoint.pt")
    path = work / "runs" / "lift-dry" / "checkpoint.pt"
    path.parent.mkdir(parents=True)
    path.write_bytes(b"of another machine")
    assert command("run", "lift", "--dry-run", "2").status == 0
    assert not path.exists()
