"""Sensor parameters by gradient: static procedures, ordinary drives, what the data determine, what would help."""
