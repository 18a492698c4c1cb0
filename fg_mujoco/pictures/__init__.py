"""Pictures: plots, 3D rendering, reports and the live view.

`pages` is the kit of all HTML pages, tables and pictures on paper. `plots` draws tracks and races, and `course_drawing`
the courses in them. `report` makes the page of a run and `debug` that of its decisions, `rendering` draws pictures and
videos in 3D, and `live` shows a race as it is driven. All of it needs extras, which are imported when they are used.
"""
