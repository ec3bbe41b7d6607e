"""The commands that train, evaluate and report: what is refused is one line and exit status 2, and writes nothing."""

from __future__ import annotations

import pytest
from support.folders import snapshot

torch = pytest.importorskip("torch", reason="needs the train extra")
pytest.importorskip("onnx", reason="needs the train extra")
pytest.importorskip("tensorboard", reason="needs the train extra")

from anyprobe.learning.train import loop  # noqa: E402
from anyprobe.learning.train.checkpoint import save_checkpoint  # noqa: E402
from anyprobe.learning.train.config import RUNS, smoke  # noqa: E402
from anyprobe.learning.train.loop import make_learner  # noqa: E402

TEST_ASSETS = ("--hdri", "h", "--meshes", "m")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("train", "lift", "--device", "gpu"), "--device gpu: expected one of cpu, cuda"),
        (("train", "lift", "--steps", "9", "--dry-run", "2"), "--steps and --dry-run: "),
        (("train", "lft"), "did you mean lift?"),
        (("train", "mask"), "in a clone, with python -m anyprobe.learning.mask_network"),
        (("train", "lift", "--init-weights", "none.pt"), "none.pt: no such file"),
        (("train", "paper"), "expected --init-weights with a trained irradiance net, got none"),
        (("train", "lift", "--teacher", "lift.pt"), "--teacher lift.pt: expected a run of the paper's chain, got lift"),
        (("weights", "o", "mask"), "in a clone, with python -m anyprobe.learning.mask_network"),
        (("weights", "o", "lift"), "no such checkpoint; train first"),
        (("evaluate", *TEST_ASSETS, "--frozen", "--seed", "5"), "--seed 5: expected pairs drawn at random"),
        (("evaluate", *TEST_ASSETS, "--frozen", "--pairs", "2000"), "--pairs 2000: expected at most 1000"),
    ],
)
def test_what_is_refused_is_one_line(work, command, arguments, words):
    before = snapshot(work)
    assert words in command(*arguments).complaint
    assert snapshot(work) == before


def test_a_gpu_that_is_not_there_is_one_line(work, command, monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    assert "--device cuda: no GPU" in command("train", "lift", "--device", "cuda").complaint
    assert not list(work.iterdir())


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
        assert "got the run's own checkpoint" in command("weights", *arguments).complaint
        assert snapshot(work) == before


def test_a_damaged_checkpoint_is_one_line(work, command):
    path = write_run(work, "normals")
    path.write_bytes(path.read_bytes()[:5000])
    before = snapshot(work)
    for asked in (("train", "normals"), ("weights", "o", "normals"), ("weights", "o", "normals", "--keep", "s.pt")):
        assert "expected a run's checkpoint, got a damaged file" in command(*asked).complaint
    assert snapshot(work) == before


def test_a_dry_run_begins_anew_each_time(work, command, monkeypatch):
    monkeypatch.setattr(loop, "train", lambda config, *, runs, **given: runs / config.name / "checkpoint.pt")
    path = work / "runs" / "lift-dry" / "checkpoint.pt"
    path.parent.mkdir(parents=True)
    path.write_bytes(b"of another machine")
    assert command("train", "lift", "--dry-run", "2").status == 0
    assert not path.exists()
