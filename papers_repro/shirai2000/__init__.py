"""Shirai, Koizumi, Takemoto, Adachi (2000): altitude from accelerometer and vehicle speed sensor."""
