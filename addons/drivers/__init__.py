"""Planners beyond the gap planners: they localise themselves, follow lines, or overtake."""
