"""Processes that train together end with the same weights, the mean of what each one learned."""

import os
import socket

import pytest

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
