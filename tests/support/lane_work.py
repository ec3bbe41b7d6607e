"""Work for the server's decoding processes, in a module of its own: they import what they are given."""

from __future__ import annotations

import os
import time


def out_of_memory() -> None:
    """What ONNX Runtime raises."""
    raise RuntimeError("[ONNXRuntimeError] : 6 : RUNTIME_EXCEPTION : Non-zero status code: std::bad_alloc")


def end_itself(flag: str, number: int, times: int) -> str:
    """End by a signal, for so many times; then answer."""
    with open(flag, "a+", encoding="utf-8") as stream:
        stream.write("x")
        stream.seek(0)
        count = len(stream.read())
    if count <= times:
        if number:
            os.kill(os.getpid(), number)
        os._exit(3)
    return "done"


def take(processor_s: float, sleep_s: float) -> str:
    """Work and sleep by turns, as one does that others leave little of the processor."""
    start = time.process_time()
    while time.process_time() - start < processor_s:
        until = time.process_time() + 0.02
        while time.process_time() < until:
            pass
        time.sleep(sleep_s)
    return "done"
