"""The kernel behind `attitude.fit_attitudes`: cost, Levenberg-Marquardt steps and their trigonometry, in chunks."""
