"""Inference that knows nothing of sensors: states by name, their smoother, and most probable noise levels."""
