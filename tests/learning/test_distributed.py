"""Processes that train together end with the same weights, the mean of what each one learned."""

import os
import socket

import pytest
from support.refused import refused

torch = pytest.importorskip("torch", reason="needs ./train[torch]")

from torch import nn  # noqa: E402
from torch.multiprocessing import spawn  # noqa: E402

from anyprobe_train.train.loop import ProcessGroup  # noqa: E402


def work(rank: int, port: int, folder: str) -> None:
    """One process: its own gradients and statistics, then what the team makes of them."""
    os.environ.update(
        RANK=str(rank), WORLD_SIZE="2", LOCAL_RANK=str(rank), MASTER_ADDR="127.0.0.1", MASTER_PORT=str(port)
    )
    torch.set_num_threads(1)
    processes = ProcessGroup()
    torch.manual_seed(7)  # the same weights
    net = nn.Sequential(nn.Linear(3, 2), nn.BatchNorm1d(2))
    torch.manual_seed(rank)  # other pairs
    net(torch.rand(5, 3)).square().sum().backward()
    own = [p.grad.clone() for p in net.parameters()]
    own_mean = net[1].running_mean.clone()
    asked = [processes.average_gradients(net.parameters(), ask) for ask in (processes.is_first, not processes.is_first)]
    processes.average_statistics(net)
    mean = net[1].running_mean.clone()
    gradients = [p.grad.clone() for p in net.parameters()]
    torch.save((own, gradients, own_mean, mean, asked), f"{folder}/{rank}.pt")
    processes.leave()


def test_two_processes_agree_on_gradients_statistics_and_when_to_save(tmp_path):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    spawn(work, (port, str(tmp_path)), nprocs=2)
    given = [torch.load(tmp_path / f"{rank}.pt", weights_only=True) for rank in range(2)]
    assert not torch.equal(given[0][0][0], given[1][0][0])
    for rank in range(2):
        for one, other, averaged in zip(given[0][0], given[1][0], given[rank][1], strict=True):
            torch.testing.assert_close(averaged, (one + other) / 2)
        torch.testing.assert_close(given[rank][3], (given[0][2] + given[1][2]) / 2)
        assert given[rank][4] == [True, False]  # the first process decides


def test_one_process_is_a_team_of_its_own(monkeypatch):
    for name in ("RANK", "WORLD_SIZE"):
        monkeypatch.delenv(name, raising=False)
    processes = ProcessGroup()
    assert processes.is_first
    assert processes.device == "cpu"
    net = nn.Linear(2, 1)
    net(torch.ones(1, 2)).sum().backward()
    before = net.weight.grad.clone()
    assert processes.average_gradients(net.parameters(), True)
    assert torch.equal(net.weight.grad, before)


@pytest.mark.parametrize(
    ("kind", "gpu", "backend", "device"),
    [("cpu", True, "gloo", "cpu"), ("cpu", False, "gloo", "cpu"), ("cuda", True, "nccl", "cuda:1")],
)
def test_processes_speak_as_the_device_that_they_train_on_can(monkeypatch, kind, gpu, backend, device):
    """A GPU that is there and not asked for changes nothing: gradients are the CPU's."""
    asked = []
    for name in ("RANK", "LOCAL_RANK"):
        monkeypatch.setenv(name, "1")
    monkeypatch.setenv("WORLD_SIZE", "2")
    monkeypatch.setattr(torch.cuda, "is_available", lambda: gpu)
    monkeypatch.setattr(torch.distributed, "init_process_group", asked.append)
    assert ProcessGroup(kind).device == device
    assert asked == [backend]


def test_a_device_that_is_not_there_is_one_clear_line(monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with refused("device", source="gpu", naming="cuda"):
        ProcessGroup("gpu")
    with refused("device", source="cuda", naming="no GPU"):
        ProcessGroup("cuda")
