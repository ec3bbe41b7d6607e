"""The dataset on a Ray cluster: a node is killed half-way, and the folder is the same byte for byte."""

from __future__ import annotations

import os
import time
from collections import defaultdict
from functools import partial
from pathlib import Path

import pytest
from support.drawn_pairs import DrawnRenderer
from support.folders import snapshot

from anyprobe.errors import AnyprobeError, InputError
from anyprobe.learning.dataset import render_job
from anyprobe.learning.dataset.process_pools import WorkerFailed, run_local, run_ray

pytest.importorskip("ray", reason="the package ray is not installed")
pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore")]  # Ray's own, and its many open files

MODULES = os.pathsep.join(map(str, (Path(__file__).parents[1], Path(__file__).parent)))
GIVEN = {"pairs": 36, "shard_size": 3, "procedural_maps": 3, "procedural_shapes": 0}


def ignore(*_) -> None:
    pass


def traced(notes: Path, victim: str, work, shard: int, tell) -> None:
    """Work that leaves a note of the node before and after.

    The victim does one shard and stops in the middle of its second; the others begin then, and
    keep the last one until it has been said that the victim is lost (a minute at most).
    """
    import ray

    node = ray.get_runtime_context().get_node_id()
    second = node == victim and any(notes.glob(f"* {node} done"))
    (notes / f"{shard} {node} begun").touch()

    def given(count: int) -> None:
        if second and count == 2:
            (notes / "stopped").touch()
            time.sleep(3600)
        tell(count)

    while node != victim and not (notes / "stopped").exists():
        time.sleep(0.05)
    deadline = time.monotonic() + 60
    while shard == 11 and not (notes / "said").exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    work(shard, given)
    (notes / f"{shard} {node} done").touch()


@pytest.fixture
def cluster(monkeypatch):
    """A head and another node, one CPU each."""
    from ray.cluster_utils import Cluster

    monkeypatch.setenv("PYTHONPATH", MODULES)
    monkeypatch.setenv("RAY_USAGE_STATS_ENABLED", "0")
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "object_store_memory": 80_000_000})
    yield cluster
    cluster.shutdown()


def test_node_killed_half_way_costs_nothing(cluster, tmp_path, monkeypatch):
    victim = cluster.add_node(num_cpus=1, object_store_memory=80_000_000)
    cluster.wait_for_nodes()
    notes = tmp_path / "notes"
    notes.mkdir()
    said, done = [], {}

    def watch(shard: int, count: int) -> None:
        done[shard] = count
        if (notes / "stopped").exists() and not (notes / "killed").exists():
            (notes / "killed").touch()
            cluster.remove_node(victim, allow_graceful=False)

    def say(line: str) -> None:
        said.append(line)
        (notes / "said").touch()

    def on_ray(work, tasks, given):
        work = partial(traced, notes, victim.node_id, work)
        run_ray(work, tasks, given, address=cluster.address, log=say)

    job = render_job.begin(tmp_path / "ray", GIVEN, None, DrawnRenderer, resume=False)
    render_job.render_missing(job, on_ray, watch)

    local = render_job.begin(tmp_path / "local", GIVEN, None, DrawnRenderer, resume=False)
    render_job.render_missing(local, partial(run_local, workers=2, log=said.append), ignore)
    assert snapshot(tmp_path / "ray") == snapshot(tmp_path / "local")
    assert set(done) == set(range(12))

    steps = defaultdict(set)
    for path in notes.glob("* *"):
        shard, node, step = path.name.split()
        steps[step].add((int(shard), node))
    assert len({node for _, node in steps["done"]}) == 2  # both had their share
    ((lost, node),) = steps["begun"] - steps["done"]
    assert node == victim.node_id
    assert any(shard == lost for shard, _ in steps["done"])
    (line,) = said
    assert victim.node_id[:8] in line
    assert "was lost" in line


def fails(kind: str, task: int, tell) -> None:
    if kind == "ours":
        raise InputError(f"task {task}: expected an egg, got a stone")
    if kind == "any":
        raise ZeroDivisionError("by zero")
    os._exit(1)


@pytest.mark.parametrize(
    ("kind", "error", "text"),
    [
        ("ours", InputError, r"^task 0: expected an egg, got a stone$"),
        ("any", WorkerFailed, r"task 0: .*ZeroDivisionError"),
        ("death", WorkerFailed, r"task 0: .*lost 3 times"),
    ],
)
def test_errors_are_those_of_the_local_engine(cluster, kind, error, text):
    with pytest.raises(error, match=text) as raised:
        run_ray(partial(fails, kind), [0], ignore, address=cluster.address, log=ignore)
    assert type(raised.value) is error
    assert len(str(raised.value).splitlines()) == 1


def test_cluster_that_is_not_there_is_one_line():
    with pytest.raises(AnyprobeError, match="expected a Ray cluster, got no answer") as raised:
        run_ray(partial(fails, "ours"), [0], ignore, address="127.0.0.1:1", log=ignore)
    assert len(str(raised.value).splitlines()) == 1


def test_without_an_address_a_cluster_is_begun_here(tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", MODULES)
    job = render_job.begin(tmp_path / "set", GIVEN, None, DrawnRenderer, resume=False)
    counts = {}
    render_job.render_missing(
        job, partial(run_ray, workers=1, log=ignore, finished=lambda shard: 3), counts.__setitem__
    )
    assert counts == dict.fromkeys(range(12), 3)
    assert job.missing() == []
