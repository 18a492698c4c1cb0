"""All doors, by their names. Each writes inputs that are right once, and for each try changes them and uses them."""

from . import course_doors, driving_doors, folder_doors, other_doors, planner_doors

DOORS = course_doors.DOORS | planner_doors.DOORS | folder_doors.DOORS | driving_doors.DOORS | other_doors.DOORS
