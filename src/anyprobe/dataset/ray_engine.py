"""The same tasks on a Ray cluster: any node may take any task, and a lost node's tasks go to others."""

from __future__ import annotations

import os
import socket
from collections.abc import Callable, Sequence
from typing import Any

from anyprobe.dataset.local_engine import ATTEMPTS, Work, WorkerFailed
from anyprobe.errors import AnyprobeError, InputError, MissingExtra

AHEAD = 2
"""Tasks handed to Ray per CPU; the rest wait here, so that a long job stays light."""

KNOCK_S = 10.0

_QUIET = {
    "RAY_USAGE_STATS_ENABLED": "0",
    "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO": "0",  # else ray.init warns of a change of theirs
}


def run_ray(
    work: Work,
    tasks: Sequence[Any],
    watch: Callable[[Any, int], None],
    *,
    address: str | None = None,
    workers: int = 2,
    say: Callable[[str], None],
    finished: Callable[[Any], int] = lambda task: 1,
) -> dict[Any, Any]:
    """Do every task on a cluster, one CPU each; result by task.

    address: a cluster's, "auto" for the one this machine is a node of; None begins one here
    with so many workers, which ends with this call. watch(task, finished(task)) tells of
    each task that is done. Tasks must not mind being done twice: a node that was given up
    may still be at work.

    Raises:
        AnyprobeError: what a task raised; its other exceptions, and a task whose
            workers were lost three times, as WorkerFailed.
    """
    ray = _connect(address, workers)
    try:
        remote = ray.remote(num_cpus=1, max_retries=ATTEMPTS - 1, scheduling_strategy="SPREAD")(_call)
        shared = ray.put(work)
        waiting, running, results = list(reversed(tasks)), {}, {}
        nodes = _alive(ray)
        while waiting or running:
            cpus = int(ray.cluster_resources().get("CPU", 1))
            while waiting and len(running) < AHEAD * max(1, cpus):
                task = waiting.pop()
                running[remote.remote(shared, task)] = task
            ready, _ = ray.wait(list(running), num_returns=1, timeout=1.0)
            for reference in ready:
                task = running.pop(reference)
                results[task] = _result(ray, reference, task)
                watch(task, finished(task))
            now = _alive(ray)
            for node in sorted(nodes - now):
                say(f"node {node} was lost; what it had in hand is done again by others")
            nodes = now
        return results
    finally:
        ray.shutdown()


def _call(work: Work, task: Any) -> Any:
    return work(task, lambda count: None)


def _result(ray, reference: Any, task: Any) -> Any:
    try:
        return ray.get(reference)
    except ray.exceptions.RayTaskError as error:
        if isinstance(error.cause, AnyprobeError):
            raise error.cause from None
        reason = f"{type(error.cause).__name__}: {_short(error.cause)}"
        raise WorkerFailed(f"task {task}: expected a result, got {reason}") from error
    except ray.exceptions.RayError as error:
        raise WorkerFailed(
            f"task {task}: expected a result, but its workers were lost {ATTEMPTS} times ({_short(error)})"
        ) from error


def _short(error: BaseException) -> str:
    return " ".join(str(error).split())[:160]


def _alive(ray) -> set[str]:
    return {f"{node['NodeManagerAddress']} ({node['NodeID'][:8]})" for node in ray.nodes() if node["Alive"]}


def _connect(address: str | None, workers: int):
    for name, value in _QUIET.items():
        os.environ.setdefault(name, value)
    try:
        import ray
    except ImportError as error:
        raise MissingExtra("ray", "ray", "--engine ray") from error
    if address is None:
        where = {"num_cpus": workers, "include_dashboard": False}
    else:
        _knock(address)
        where = {"address": address}
    try:
        ray.init(**where, log_to_driver=False, logging_level="ERROR", configure_logging=False)
    except Exception as error:  # of many kinds, bare ones too
        ray.shutdown()
        raise InputError(
            f"--engine ray: expected a cluster {f'at {address}' if address else 'to begin here'}, "
            f"got {type(error).__name__} ({_short(error)}); see `ray status`"
        ) from error
    return ray


def _knock(address: str) -> None:
    """Ray itself tries for minutes and then ends the process."""
    host, _, port = address.removeprefix("ray://").rpartition(":")
    if not host:  # "auto" and the like: found by files on this machine
        return
    try:
        socket.create_connection((host, int(port)), timeout=KNOCK_S).close()
    except (OSError, ValueError) as error:
        raise InputError(
            f"--address {address}: expected a Ray cluster, got no answer ({_short(error)}); see `ray status`"
        ) from error
