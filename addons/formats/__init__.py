"""Files as teams have them: courses and lines in JSON, NumPy, YAML and as two boundaries; and cars.

The core reads tables of columns by their names (fg_mujoco.course.line_file); here such tables are made.
"""
