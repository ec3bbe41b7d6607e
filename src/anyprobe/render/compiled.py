"""How shading functions are compiled: into one loop over samples, nothing stored between its parts."""

from __future__ import annotations

from collections.abc import Callable

INDUCTOR_OPTIONS = {
    # By default the compiler writes every long expression to memory and reads it back, and
    # checks each index. 6,200 points x 64 samples on two cores: 27 ms so, 5 ms with these.
    "realize_opcount_threshold": 100_000,
    "realize_reads_threshold": 100_000,
    "assert_indirect_indexing": False,
}


def compile_kernel(function: Callable) -> Callable:
    """torch.compile for shade_specular, shade_diffuse and lookup; one kernel for each size of arguments."""
    import torch

    return torch.compile(function, options=INDUCTOR_OPTIONS, dynamic=False)
