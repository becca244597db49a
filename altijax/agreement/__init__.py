"""Streams of a recording that must agree: correlated over lags, judged, and told by their likely cause."""
