"""Recordings that are made up: the one that is shipped, and drives of cars whose errors nobody knows."""
