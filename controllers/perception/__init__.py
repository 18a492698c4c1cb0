"""Perception of planners: bearings of beams (scan_geometry), filters (scan_filters), gaps, and the local map."""
