"""One smoother of a vehicle's motion from whatever sensors a recording has: states and measurements by name."""
