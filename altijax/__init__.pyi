"""The public names, each once: on first use they are imported from these modules."""

from . import (
    altitude as altitude,
    attitude as attitude,
    constants as constants,
    datasets as datasets,
    delays as delays,
    doppler as doppler,
    drives as drives,
    earth as earth,
    estimates as estimates,
    gradients as gradients,
    instruments as instruments,
    least_squares as least_squares,
    metrics as metrics,
    motions as motions,
    plots as plots,
    programs as programs,
    recordings as recordings,
    roads as roads,
    rotation_splines as rotation_splines,
    rotations as rotations,
    sensors as sensors,
    signals as signals,
    simulation as simulation,
    smoothing as smoothing,
    speed as speed,
    strapdown as strapdown,
    sweeps as sweeps,
    tables as tables,
    wahba as wahba,
    wheels as wheels,
)
from .altitude import (
    elevation_by_norm as elevation_by_norm,
    elevation_by_slope as elevation_by_slope,
    horizontal_acceleration as horizontal_acceleration,
    horizontal_distance as horizontal_distance,
    slope_sine as slope_sine,
    vertical_acceleration as vertical_acceleration,
)
from .attitude import (
    AttitudeFit as AttitudeFit,
    course_attitude as course_attitude,
    fit_attitude as fit_attitude,
    fit_attitudes as fit_attitudes,
    hold_attitudes as hold_attitudes,
)
from .calibration.allan import (
    AllanFit as AllanFit,
    allan_deviation as allan_deviation,
    averaging_factors as averaging_factors,
    fit_allan as fit_allan,
)
from .calibration.experiment_design import (
    drive_information as drive_information,
    driving_protocol as driving_protocol,
    manoeuvre_gains as manoeuvre_gains,
)
from .calibration.identifiability import (
    Identification as Identification,
    describe_undetermined as describe_undetermined,
    identify as identify,
    information_gain as information_gain,
)
from .calibration.records import (
    Calibration as Calibration,
)
from .calibration.serial_correlation import (
    mean_with_std as mean_with_std,
    statistical_inefficiency as statistical_inefficiency,
)
from .calibration.simulated_drives import (
    Manoeuvres as Manoeuvres,
    recorded_drive as recorded_drive,
    town_drive as town_drive,
)
from .calibration.standstill import (
    means_at_rest as means_at_rest,
    still_samples as still_samples,
)
from .calibration.static import (
    SensorFit as SensorFit,
    fit_accelerometer_positions as fit_accelerometer_positions,
    fit_accelerometer_temperature as fit_accelerometer_temperature,
    fit_gyro_at_rest as fit_gyro_at_rest,
    fit_gyro_temperature as fit_gyro_temperature,
)
from .datasets import (
    DatasetNotFoundError as DatasetNotFoundError,
    dataset_path as dataset_path,
    list_datasets as list_datasets,
    load_dataset as load_dataset,
)
from .delays import (
    Delay as Delay,
    estimate_delay as estimate_delay,
)
from .doppler import (
    DopplerReceiver as DopplerReceiver,
    course_to_velocity as course_to_velocity,
    doppler_velocity as doppler_velocity,
    velocity_to_course as velocity_to_course,
)
from .drives import (
    gravity_at as gravity_at,
)
from .earth import (
    ecef_to_geodetic as ecef_to_geodetic,
    enu_axes as enu_axes,
    enu_to_geodetic as enu_to_geodetic,
    geodetic_to_ecef as geodetic_to_ecef,
    geodetic_to_enu as geodetic_to_enu,
    normal_gravity as normal_gravity,
)
from .estimates import (
    calibrate as calibrate,
    estimate_elevation as estimate_elevation,
    estimate_motion as estimate_motion,
    estimate_speed as estimate_speed,
    outage_errors as outage_errors,
    outage_table as outage_table,
    score_elevation as score_elevation,
    score_motion as score_motion,
    withheld_gnss_errors as withheld_gnss_errors,
)
from .formats.registry import (
    register_format as register_format,
)
from .gradients import (
    differentiable as differentiable,
    sensitivity as sensitivity,
)
from .instruments import (
    DOPPLER_1_HZ as DOPPLER_1_HZ,
    FIBRE_OPTIC_GYRO as FIBRE_OPTIC_GYRO,
    JA_5V as JA_5V,
    MEMS_ACCELEROMETER as MEMS_ACCELEROMETER,
    MEMS_GYRO as MEMS_GYRO,
    ND_PG1 as ND_PG1,
    VIBRATION_GYRO as VIBRATION_GYRO,
)
from .least_squares import (
    Fit as Fit,
    levenberg_marquardt as levenberg_marquardt,
)
from .metrics import (
    accuracy_denominator as accuracy_denominator,
    coverage as coverage,
    rms as rms,
    rms_without_offset as rms_without_offset,
)
from .motions import (
    Readings as Readings,
    Windsurfer as Windsurfer,
    flight_pose as flight_pose,
    gybing_windsurfer as gybing_windsurfer,
    ideal_readings as ideal_readings,
    road_pose as road_pose,
    windsurfer_pose as windsurfer_pose,
)
from .plots import (
    house_style as house_style,
    plot_calibration as plot_calibration,
    plot_calibration_correlation as plot_calibration_correlation,
    plot_calibration_errors as plot_calibration_errors,
    plot_elevation as plot_elevation,
    plot_elevation_error as plot_elevation_error,
    plot_map as plot_map,
    plot_motion as plot_motion,
    plot_speed as plot_speed,
    plot_streams as plot_streams,
    plot_sweep as plot_sweep,
)
from .programs import (
    count_programs as count_programs,
    keep_programs as keep_programs,
)
from .recordings import (
    Recording as Recording,
    RecordingError as RecordingError,
    RecordingWarning as RecordingWarning,
    describe as describe,
    read_recording as read_recording,
)
from .roads import (
    Road as Road,
    SpeedProfile as SpeedProfile,
    circular_road as circular_road,
    progress as progress,
    rest_to_rest as rest_to_rest,
    road_curve as road_curve,
    slope_road as slope_road,
    winding_road as winding_road,
)
from .rotation_splines import (
    rotation_spline as rotation_spline,
)
from .rotations import (
    euler_to_matrix as euler_to_matrix,
    heading_to_yaw as heading_to_yaw,
    interpolate_rotations as interpolate_rotations,
    matrix_to_euler as matrix_to_euler,
    matrix_to_quaternion as matrix_to_quaternion,
    matrix_to_rotvec as matrix_to_rotvec,
    quaternion_to_matrix as quaternion_to_matrix,
    rotvec_to_matrix as rotvec_to_matrix,
    skew as skew,
    vee as vee,
    wrap_angle as wrap_angle,
    yaw_to_heading as yaw_to_heading,
)
from .sensors import (
    Accelerometer as Accelerometer,
    Gyro as Gyro,
    accelerometer_output as accelerometer_output,
    correct_accelerometer as correct_accelerometer,
    correct_gyro as correct_gyro,
    gyro_output as gyro_output,
    saturated as saturated,
)
from .signals import (
    cumulative_integral as cumulative_integral,
    derivative as derivative,
    fourier_interval_means as fourier_interval_means,
    fourier_reconstruction as fourier_reconstruction,
    interval_means as interval_means,
    low_pass as low_pass,
    periodic_extension as periodic_extension,
    resample as resample,
)
from .simulation import (
    simulate_recording as simulate_recording,
)
from .smoothing import (
    SmoothVelocity as SmoothVelocity,
    match_endpoints as match_endpoints,
    smooth_velocity as smooth_velocity,
)
from .speed import (
    pitch_rate as pitch_rate,
    pure_acceleration as pure_acceleration,
    roll_angle as roll_angle,
    speed_error_growth as speed_error_growth,
    speed_with_aided_roll as speed_with_aided_roll,
    speed_with_roll as speed_with_roll,
    speed_without_roll as speed_without_roll,
)
from .speed_estimate.filter import (
    SpeedTrack as SpeedTrack,
    filter_speed as filter_speed,
)
from .speed_estimate.model import (
    SpeedNoise as SpeedNoise,
    state_names as state_names,
)
from .strapdown import (
    integrate_attitude as integrate_attitude,
    integrate_position as integrate_position,
    integrate_velocity as integrate_velocity,
)
from .streaming import (
    FilterSample as FilterSample,
    FilterState as FilterState,
    LoopSample as LoopSample,
    LoopState as LoopState,
    filter_start as filter_start,
    filter_step as filter_step,
    speed_start as speed_start,
    speed_step as speed_step,
    state_from_dict as state_from_dict,
    state_to_dict as state_to_dict,
)
from .sweeps import (
    read_off as read_off,
    sweep as sweep,
)
from .tables import (
    recording_from_tables as recording_from_tables,
    save_estimate as save_estimate,
)
from .vehicle.estimates import estimate_drive as estimate_drive
from .wahba import (
    SharedAttitude as SharedAttitude,
    fit_shared_attitude as fit_shared_attitude,
    fit_windows as fit_windows,
    nearest_rotation as nearest_rotation,
)
from .wheels import (
    WheelSensor as WheelSensor,
    correct_wheel_speeds as correct_wheel_speeds,
    pulse_distance as pulse_distance,
    speed_from_pulses as speed_from_pulses,
    standstill_from_pulses as standstill_from_pulses,
    way_from_pulses as way_from_pulses,
    wheel_pulses as wheel_pulses,
    wheel_speeds as wheel_speeds,
    yaw_rate_from_wheels as yaw_rate_from_wheels,
)
