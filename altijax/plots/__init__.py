"""Pictures: matplotlib Axes in, the same Axes out, in one house style."""

from altijax.plots.calibration import (
    plot_calibration as plot_calibration,
    plot_calibration_correlation as plot_calibration_correlation,
    plot_calibration_errors as plot_calibration_errors,
)
from altijax.plots.elevation import (
    plot_elevation as plot_elevation,
    plot_elevation_error as plot_elevation_error,
)
from altijax.plots.map import plot_map as plot_map
from altijax.plots.motion import plot_motion as plot_motion
from altijax.plots.speed import plot_speed as plot_speed
from altijax.plots.streams import plot_streams as plot_streams
from altijax.plots.style import house_style as house_style
from altijax.plots.sweeps import plot_sweep as plot_sweep
