"""Sessions: opened alike by all who run a graph, quiet between runs, and one clear line where a file is damaged."""

import os
import subprocess
import sys
from types import SimpleNamespace

import pytest
from support.refused import refused

from anyprobe.errors import InputError
from anyprobe.files import graphs
from anyprobe.files.graphs import CPU, open_graph
from anyprobe.masks.networks import default_graph


def test_threads_do_not_spin_and_are_as_many_as_asked():
    graph = default_graph()
    options = open_graph(graph, 2).get_session_options()
    assert options.get_session_config_entry("session.intra_op.allow_spinning") == "0"
    assert options.intra_op_num_threads == 2
    assert open_graph(graph, 7).get_session_options().intra_op_num_threads == 2


def test_a_damaged_graph_is_one_clear_line(tmp_path):
    path = tmp_path / "light.onnx"
    path.write_bytes(b"no graph")
    with refused(code="invalid-model", source="light.onnx", naming="cannot be opened"):
        open_graph(path)


@pytest.mark.ci
def test_the_runtime_tells_nobody(tmp_path):
    """Its telemetry keeps a database, from which it sends; and the host's environment stays as it was."""
    code = (
        "import os, anyprobe, time; from anyprobe.estimate.runtime import Models; Models('lift'); time.sleep(0.3);"
        "assert 'ORT_DISABLE_TELEMETRY' not in os.environ"
    )
    here = {name: value for name, value in os.environ.items() if name not in ("CI", "PYTEST_CURRENT_TEST")}
    subprocess.run([sys.executable, "-c", code], env={**here, "XDG_CACHE_HOME": str(tmp_path)}, check=True)
    assert not list(tmp_path.rglob("*onnxruntime*"))


def test_provider_that_is_absent_is_refused(monkeypatch):
    with refused("providers", naming="CPUExecutionProvider"):
        open_graph(default_graph(), providers=["OnyxExecutionProvider"])


def test_provider_that_cannot_work_is_never_replaced_in_silence(monkeypatch):
    session = SimpleNamespace(get_providers=lambda: list(CPU))
    monkeypatch.setattr(graphs.onnxruntime, "get_available_providers", lambda: ["CUDAExecutionProvider", *CPU])
    monkeypatch.setattr(graphs.onnxruntime, "InferenceSession", lambda *_, **how: session)
    with refused("providers", code="unsupported", kind=InputError):
        open_graph(default_graph(), providers=["CUDAExecutionProvider", *CPU])
