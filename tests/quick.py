"""Compilation for tests that run a program on few numbers."""

from functools import partial

import jax

# XLA's optimizations would take several times as long as they could save.
quick_jit = partial(
    jax.jit, compiler_options={"xla_backend_optimization_level": 0, "xla_cpu_use_fusion_emitters": False}
)
