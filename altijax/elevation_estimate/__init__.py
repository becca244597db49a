"""Elevation of a recorded drive: its model, its smoother, what is likely given known heights, its calibration."""
