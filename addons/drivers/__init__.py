"""Planners and stages beyond the gap planners: they learn, localise themselves, follow lines, or overtake."""
