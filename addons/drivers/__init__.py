"""Planners and stages beyond the gap planners: they remember, learn, localise themselves, follow lines, or overtake."""
