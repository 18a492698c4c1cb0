"""Pictures: plots, 3D rendering, reports and the live view.

`plots` draws tracks and races by matplotlib, and `course_drawing` the courses in them. `rendering` draws pictures and
videos in 3D, `report` makes HTML pages of runs, and `live` shows a race as it is driven. All of it needs extras, which
are imported when they are used.
"""
