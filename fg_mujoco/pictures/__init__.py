"""Pictures: `rendering` draws in 3D, `plots` courses and races, and `pages` is the kit of pages, tables and figures."""
