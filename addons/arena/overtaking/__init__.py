"""The overtaking benchmark: one planner behind one slower opponent, many times.

overtaking   plans the duels, drives those that are missing, and writes the report
duel         one duel: who starts where, when it counts as an overtake, and who is to blame for a touch
opponents    the cars ahead: their lines, and how fast they are
tables       the report: CSV, Markdown with intervals, and a picture
"""
