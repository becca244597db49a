"""Altitude, speed and attitude from inertial sensors, wheel speed and GNSS Doppler.

Sensor models are functions, estimators invert them, integrators iterate them; all are plain JAX functions of arrays, so
every result has a gradient, a batch axis and an error bar.

Frames
------
n   navigation: East, North, up (ENU)
b   body: x forward, y left, z up (FLU), the axes of the IMU after its axes code was applied
e   Earth-centred, Earth-fixed (ECEF), WGS 84

``C_nb`` maps body vectors to navigation vectors and is the one currency for attitude. Euler angles (roll, pitch, yaw)
stand at the boundary only: right side down, nose up and counter-clockwise from East are positive, so

    C_nb = Rz(yaw) Ry(-pitch) Rx(roll)

With y to the left, nose-up pitch is minus the angle of ISO 8855 and ROS: scipy's ``from_euler("ZYX", [yaw, -pitch,
roll])``. ``heading`` is clockwise from North in [0, 2 pi), pi/2 - yaw. The papers' axes: [chalko2010] is ENU and FLU,
its R is the transpose of C_nb; [us20060293826] is forward-right-down, which flips the signs of y and z.

Quantities
----------
f_b       specific force (..., 3) m/s^2, what an accelerometer measures: +g on z at rest
w_b       angular rate of the body (..., 3) rad/s
v_n, f_n  velocity m/s and specific force m/s^2 in navigation axes
speed     along body x, m/s; `way` is its integral, m
elevation height above the first sample, m
gravity   magnitude, m/s^2: `normal_gravity` where the site is known, else 9.80665

SI units and radians everywhere; a name in other units says so (`_deg`). A sensor's parameters turn readings into truth
by ``true = measured / scale - bias`` (nominal 1 and 0); a true speed is ``wheel_scale`` times the wheels' speed.

Shapes
------
Vectors (..., 3), matrices (..., 3, 3); series: scalars (..., time), vectors (..., time, 3). Leading axes are batch
axes. Closed forms broadcast over them; what iterates is written for one problem and takes `jax.vmap`.

Precision
---------
Array functions keep the precision of their input and importing altijax never changes `jax.config`: call
``jax.config.update("jax_enable_x64", True)`` first when you use them yourself. The verbs that take a recording compute
in double precision whatever the flag says.

References
----------
[shirai2000]     Shirai, Koizumi, Takemoto, Adachi: Fundamental study on real time measurement of altitude data with
                 accelerometer and vehicle speed sensor. Int. Archives of Photogrammetry and Remote Sensing XXXIII,
                 2000.
[us20060293826]  US patent application 2006/0293826: speed by dead reckoning with roll angle.
[chalko2010]     Chalko: Combining accelerations and GPS-Doppler velocities. 2010.
"""

import os
from importlib import import_module
from typing import TYPE_CHECKING

from altijax.altitude import (
    elevation_by_norm,
    elevation_by_slope,
    horizontal_acceleration,
    horizontal_distance,
    slope_sine,
    vertical_acceleration,
)
from altijax.attitude import (
    AttitudeFit,
    course_attitude,
    fit_attitude,
    fit_attitudes,
    hold_attitudes,
)
from altijax.calibration.allan import (
    AllanFit,
    allan_deviation,
    averaging_factors,
    fit_allan,
)
from altijax.calibration.experiment_design import (
    drive_information,
    driving_protocol,
    manoeuvre_gains,
)
from altijax.calibration.identifiability import (
    Identification,
    describe_undetermined,
    identify,
    information_gain,
)
from altijax.calibration.serial_correlation import (
    mean_with_std,
    statistical_inefficiency,
)
from altijax.calibration.simulated_drives import (
    Manoeuvres,
    recorded_drive,
    town_drive,
)
from altijax.calibration.standstill import (
    means_at_rest,
    still_samples,
)
from altijax.calibration.static import (
    SensorFit,
    fit_accelerometer_positions,
    fit_accelerometer_temperature,
    fit_gyro_at_rest,
    fit_gyro_temperature,
)
from altijax.delays import (
    Delay,
    estimate_delay,
)
from altijax.doppler import (
    DopplerReceiver,
    course_to_velocity,
    doppler_velocity,
    velocity_to_course,
)
from altijax.earth import (
    ecef_to_geodetic,
    enu_axes,
    enu_to_geodetic,
    geodetic_to_ecef,
    geodetic_to_enu,
    normal_gravity,
)
from altijax.instruments import (
    DOPPLER_1_HZ,
    FIBRE_OPTIC_GYRO,
    JA_5V,
    MEMS_ACCELEROMETER,
    MEMS_GYRO,
    ND_PG1,
    VIBRATION_GYRO,
)
from altijax.least_squares import (
    Fit,
    levenberg_marquardt,
)
from altijax.metrics import (
    accuracy_denominator,
    coverage,
    rms,
    rms_without_offset,
)
from altijax.motions import (
    Readings,
    Windsurfer,
    flight_pose,
    gybing_windsurfer,
    ideal_readings,
    road_pose,
    windsurfer_pose,
)
from altijax.roads import (
    Road,
    SpeedProfile,
    circular_road,
    progress,
    rest_to_rest,
    road_curve,
    slope_road,
    winding_road,
)
from altijax.rotation_splines import (
    rotation_spline,
)
from altijax.rotations import (
    euler_to_matrix,
    heading_to_yaw,
    interpolate_rotations,
    matrix_to_euler,
    matrix_to_quaternion,
    matrix_to_rotvec,
    quaternion_to_matrix,
    rotvec_to_matrix,
    skew,
    vee,
    wrap_angle,
    yaw_to_heading,
)
from altijax.sensors import (
    Accelerometer,
    Gyro,
    accelerometer_output,
    correct_accelerometer,
    correct_gyro,
    gyro_output,
    saturated,
)
from altijax.signals import (
    cumulative_integral,
    derivative,
    fourier_interval_means,
    fourier_reconstruction,
    interval_means,
    low_pass,
    periodic_extension,
    resample,
)
from altijax.smoothing import (
    SmoothVelocity,
    match_endpoints,
    smooth_velocity,
)
from altijax.speed import (
    pitch_rate,
    pure_acceleration,
    roll_angle,
    speed_error_growth,
    speed_with_aided_roll,
    speed_with_roll,
    speed_without_roll,
)
from altijax.speed_estimate.filter import (
    SpeedTrack,
    filter_speed,
)
from altijax.speed_estimate.model import (
    SpeedNoise,
    state_names,
)
from altijax.strapdown import (
    integrate_attitude,
    integrate_position,
    integrate_velocity,
)
from altijax.wahba import (
    SharedAttitude,
    fit_shared_attitude,
    fit_windows,
    nearest_rotation,
)
from altijax.wheels import (
    WheelSensor,
    correct_wheel_speeds,
    pulse_distance,
    speed_from_pulses,
    standstill_from_pulses,
    way_from_pulses,
    wheel_pulses,
    wheel_speeds,
    yaw_rate_from_wheels,
)

if TYPE_CHECKING:
    from altijax.calibration.drives import (
        DriveCalibration,
        calibrate_drive,
    )
    from altijax.calibration.records import (
        Calibration,
    )
    from altijax.datasets import (
        DatasetNotFoundError,
        dataset_path,
        list_datasets,
        load_dataset,
    )
    from altijax.drives import (
        gravity_at,
    )
    from altijax.estimates import (
        calibrate,
        estimate_elevation,
        estimate_motion,
        estimate_speed,
        outage_errors,
        outage_table,
        score_elevation,
        score_motion,
        withheld_gnss_errors,
    )
    from altijax.plots import (
        plot_calibration_correlation,
        plot_calibration_errors,
        plot_elevation,
        plot_elevation_error,
        plot_streams,
    )
    from altijax.programs import (
        count_programs,
        keep_programs,
    )
    from altijax.recordings import (
        Recording,
        RecordingError,
        RecordingWarning,
        describe,
        read_recording,
    )

# Files and tables need pandas, pictures matplotlib: both are imported on first use only.
_LAZY = {
    "count_programs": "programs",
    "keep_programs": "programs",
    "Recording": "recordings",
    "RecordingError": "recordings",
    "RecordingWarning": "recordings",
    "describe": "recordings",
    "read_recording": "recordings",
    "DatasetNotFoundError": "datasets",
    "dataset_path": "datasets",
    "list_datasets": "datasets",
    "load_dataset": "datasets",
    "gravity_at": "drives",
    "DriveCalibration": "calibration.drives",
    "calibrate_drive": "calibration.drives",
    "Calibration": "calibration.records",
    "calibrate": "estimates",
    "estimate_elevation": "estimates",
    "score_elevation": "estimates",
    "estimate_speed": "estimates",
    "outage_errors": "estimates",
    "outage_table": "estimates",
    "estimate_motion": "estimates",
    "score_motion": "estimates",
    "withheld_gnss_errors": "estimates",
    "plot_calibration_correlation": "plots",
    "plot_calibration_errors": "plots",
    "plot_elevation": "plots",
    "plot_elevation_error": "plots",
    "plot_streams": "plots",
}

__all__ = [
    "DOPPLER_1_HZ",
    "FIBRE_OPTIC_GYRO",
    "JA_5V",
    "MEMS_ACCELEROMETER",
    "MEMS_GYRO",
    "ND_PG1",
    "VIBRATION_GYRO",
    "Accelerometer",
    "AllanFit",
    "AttitudeFit",
    "Calibration",
    "DatasetNotFoundError",
    "Delay",
    "DopplerReceiver",
    "DriveCalibration",
    "Fit",
    "Gyro",
    "Identification",
    "Manoeuvres",
    "Readings",
    "Recording",
    "RecordingError",
    "RecordingWarning",
    "Road",
    "SensorFit",
    "SharedAttitude",
    "SmoothVelocity",
    "SpeedNoise",
    "SpeedProfile",
    "SpeedTrack",
    "WheelSensor",
    "Windsurfer",
    "accelerometer_output",
    "accuracy_denominator",
    "allan_deviation",
    "averaging_factors",
    "calibrate",
    "calibrate_drive",
    "circular_road",
    "correct_accelerometer",
    "correct_gyro",
    "correct_wheel_speeds",
    "count_programs",
    "course_attitude",
    "course_to_velocity",
    "coverage",
    "cumulative_integral",
    "dataset_path",
    "derivative",
    "describe",
    "describe_undetermined",
    "doppler_velocity",
    "drive_information",
    "driving_protocol",
    "ecef_to_geodetic",
    "elevation_by_norm",
    "elevation_by_slope",
    "enu_axes",
    "enu_to_geodetic",
    "estimate_delay",
    "estimate_elevation",
    "estimate_motion",
    "estimate_speed",
    "euler_to_matrix",
    "filter_speed",
    "fit_accelerometer_positions",
    "fit_accelerometer_temperature",
    "fit_allan",
    "fit_attitude",
    "fit_attitudes",
    "fit_gyro_at_rest",
    "fit_gyro_temperature",
    "fit_shared_attitude",
    "fit_windows",
    "flight_pose",
    "fourier_interval_means",
    "fourier_reconstruction",
    "geodetic_to_ecef",
    "geodetic_to_enu",
    "gravity_at",
    "gybing_windsurfer",
    "gyro_output",
    "heading_to_yaw",
    "hold_attitudes",
    "horizontal_acceleration",
    "horizontal_distance",
    "ideal_readings",
    "identify",
    "information_gain",
    "integrate_attitude",
    "integrate_position",
    "integrate_velocity",
    "interpolate_rotations",
    "interval_means",
    "keep_programs",
    "levenberg_marquardt",
    "list_datasets",
    "load_dataset",
    "low_pass",
    "manoeuvre_gains",
    "match_endpoints",
    "matrix_to_euler",
    "matrix_to_quaternion",
    "matrix_to_rotvec",
    "mean_with_std",
    "means_at_rest",
    "nearest_rotation",
    "normal_gravity",
    "outage_errors",
    "outage_table",
    "periodic_extension",
    "pitch_rate",
    "plot_calibration_correlation",
    "plot_calibration_errors",
    "plot_elevation",
    "plot_elevation_error",
    "plot_streams",
    "progress",
    "pulse_distance",
    "pure_acceleration",
    "quaternion_to_matrix",
    "read_recording",
    "recorded_drive",
    "resample",
    "rest_to_rest",
    "rms",
    "rms_without_offset",
    "road_curve",
    "road_pose",
    "roll_angle",
    "rotation_spline",
    "rotvec_to_matrix",
    "saturated",
    "score_elevation",
    "score_motion",
    "skew",
    "slope_road",
    "slope_sine",
    "smooth_velocity",
    "speed_error_growth",
    "speed_from_pulses",
    "speed_with_aided_roll",
    "speed_with_roll",
    "speed_without_roll",
    "standstill_from_pulses",
    "state_names",
    "statistical_inefficiency",
    "still_samples",
    "town_drive",
    "vee",
    "velocity_to_course",
    "vertical_acceleration",
    "way_from_pulses",
    "wheel_pulses",
    "wheel_speeds",
    "winding_road",
    "windsurfer_pose",
    "withheld_gnss_errors",
    "wrap_angle",
    "yaw_rate_from_wheels",
    "yaw_to_heading",
]


def __getattr__(name: str) -> object:
    if name in _LAZY.values():
        return import_module(f"altijax.{name}")
    if name not in _LAZY:
        raise AttributeError(f"module 'altijax' has no attribute {name!r}")
    return getattr(import_module(f"altijax.{_LAZY[name]}"), name)


def __dir__() -> list[str]:
    return __all__


# Only where the user has said so by the environment: otherwise importing altijax leaves jax's configuration alone.
if os.environ.get("ALTIJAX_KEEP_PROGRAMS"):
    import_module("altijax.programs").keep_programs_as_told()
