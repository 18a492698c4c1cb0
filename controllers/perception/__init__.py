"""What a planner makes of a scan: where its beams point (scan_geometry), filters (scan_filters) and gaps (gaps)."""
