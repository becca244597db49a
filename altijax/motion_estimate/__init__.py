"""Attitude and velocity of a whole record from accelerations, gyro and Doppler velocities."""
