"""Draws the diagrams of the documentation: `python docs/diagrams [PLANNER ...]`; without a name, all of them.

It needs the extra `plot`, and Pillow.
"""

import sys

import concepts
import planners

planners.main(sys.argv[1:])
if not sys.argv[1:]:
    concepts.main()
