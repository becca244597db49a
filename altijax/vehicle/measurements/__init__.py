"""Kinds of measurements, one file each: what they read, the states they bring along, and what they should read."""
