"""Planners beyond the gap planners: they follow lines, or overtake."""
