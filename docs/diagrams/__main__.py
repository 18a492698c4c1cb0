"""Draws the diagrams of the documentation anew: `python docs/diagrams`. Needs the extra `plot`, and Pillow."""

import concepts
import planners

planners.main()
concepts.main()
