"""The commands that train, evaluate and report: what is refused is one line and exit status 2, and writes nothing."""

from __future__ import annotations

import pytest
from support.folders import snapshot

torch = pytest.importorskip("torch", reason="needs ./train[torch]")
pytest.importorskip("onnx", reason="needs ./train[torch]")
pytest.importorskip("tensorboard", reason="needs ./train[torch]")

from anyprobe.errors import ModelError  # noqa: E402
from anyprobe_train.mask_network import __main__ as mask  # noqa: E402
from anyprobe_train.mask_network.mask_training import MaskRunConfig  # noqa: E402
from anyprobe_train.train import export_onnx, loop  # noqa: E402
from anyprobe_train.train.checkpoint import read_init_weights, save_checkpoint  # noqa: E402
from anyprobe_train.train.config import RUNS, smoke  # noqa: E402
from anyprobe_train.train.export_onnx import Graph, write_graph  # noqa: E402
from anyprobe_train.train.logger import RunLogger  # noqa: E402
from anyprobe_train.train.loop import make_learner  # noqa: E402
from anyprobe_train.whole_network import __main__ as whole  # noqa: E402

TEST_ASSETS = ("--hdri", "h", "--meshes", "m")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("run", "lift", "--device", "gpu"), "--device gpu: expected one of cpu, cuda"),
        (("run", "lift", "--steps", "9", "--dry-run", "2"), "--steps and --dry-run: "),
        (("run", "lft"), "did you mean lift?"),
        (("run", "mask"), "in a clone, with python -m anyprobe_train.mask_network"),
        (("run", "lift", "--init-weights", "none.pt"), "none.pt: no such file"),
        (("run", "paper"), "train them with anyprobe-train paper"),
        (("export", "o", "paper"), "anyprobe-train paper --graphs FOLDER"),
        (("paper", "--setting", "smal"), "expected one of full, quarter, small, tiny, got 'smal'"),
        (("paper", "--only", "hdr_nets"), "did you mean hdr_net?"),
        (("paper", "--figure", "3"), "expected one of 6, 7, 10, 11, 12, got 3"),
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


def test_a_gpu_that_is_not_there_is_one_line(work, command, monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    assert "--device cuda: no GPU" in command("run", "lift", "--device", "cuda").complaint
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
        assert "got the run's own checkpoint" in command("export", *arguments).complaint
        assert snapshot(work) == before


@pytest.mark.parametrize("command_of", ["anyprobe-train export", "mask_network", "whole_network"])
def test_weights_are_kept_though_their_export_is_refused(work, command, monkeypatch, command_of):
    """What training made is not lost, and the refusal says so."""
    refusal = ModelError("expected ONNX within 0.02 of torch, got 1")

    def refuse(*_):
        raise refusal

    for module, name in ((export_onnx, "export_graphs"), (mask, "export_mask"), (whole, "export_photo_net")):
        monkeypatch.setattr(module, name, refuse)
    if command_of == "anyprobe-train export":
        write_run(work, "normals")
        assert str(refusal) in command("export", "o", "normals", "--keep", "kept.pt").complaint
    elif command_of == "mask_network":
        save_checkpoint(work / "mask.pt", MaskRunConfig(), 3, {}, {"net": {"a": torch.zeros(2)}})
        with pytest.raises(ModelError):
            mask.export(work / "mask.pt", keep=work / "kept.pt")
    else:
        net = torch.nn.Linear(2, 2)
        monkeypatch.setattr(whole, "load_photo_net", lambda *_: (net, {}))
        with pytest.raises(ModelError):
            whole.export(work / "whole.pt", share=0.0, keep=work / "kept.pt")
    assert read_init_weights(work / "kept.pt")[0]
    assert not (work / "o").exists()


@pytest.mark.filterwarnings("ignore")  # torch's exporter warns about itself
def test_a_refused_export_says_what_to_do(tmp_path):
    graph = Graph(net=torch.nn.Linear(2, 2), inputs={"input": (1, 2)})
    with pytest.raises(ModelError, match="train further; --keep FILE saves them"):
        write_graph("small", graph, (torch.ones(1, 2),), {}, tmp_path / "small.onnx", tolerance=-1.0)
    assert not list(tmp_path.iterdir())


def test_a_log_has_its_columns_before_its_first_row(tmp_path):
    """A run that is killed early says what it would have logged."""
    with RunLogger(tmp_path, "lift", ("ldr",), 0, 100, 100):
        assert (tmp_path / "log.csv").read_text().startswith("step,pairs,ldr,learning_rate")


def test_a_damaged_checkpoint_is_one_line(work, command):
    path = write_run(work, "normals")
    path.write_bytes(path.read_bytes()[:5000])
    before = snapshot(work)
    for asked in (("run", "normals"), ("export", "o", "normals"), ("export", "o", "normals", "--keep", "s.pt")):
        assert "expected a run's checkpoint, got a damaged file" in command(*asked).complaint
    assert snapshot(work) == before


def test_a_dry_run_begins_anew_each_time(work, command, monkeypatch):
    monkeypatch.setattr(loop, "train", lambda config, *, runs, **given: runs / config.name / "checkpoint.pt")
    path = work / "runs" / "lift-dry" / "checkpoint.pt"
    path.parent.mkdir(parents=True)
    path.write_bytes(b"of another machine")
    assert command("run", "lift", "--dry-run", "2").status == 0
    assert not path.exists()
