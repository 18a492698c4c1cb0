"""Compiled loops: `kernels` has the decorator; the others compile them, and keep them on disk."""
