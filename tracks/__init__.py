"""Bundled circuits: one centreline CSV each, with the recipe or seed that made it in its header."""
