"""Named instruments: those of the papers and a consumer MEMS, as records of their parameters.

Each value has its source or is marked assumed, with the reason. What differs from unit to unit is left at nominal and
its tolerance said, for ``dataclasses.replace`` to draw from. ``ISPRS 2004`` stands for Int. Archives of Photogrammetry,
Remote Sensing and Spatial Information Sciences XXXV, part B5 (Istanbul 2004), tables 1 to 3 of a later study with JA-5V
accelerometers and both kinds of gyro on a road of 164 m and 5.5 m; [shirai2000] names the JA-5V but no type of gyro.
Where analogue sensors have a "resolution", it is read as the standard deviation of the noise in the full band, and a
first-order band of B hertz passes the noise of pi / 2 B hertz.
"""

from math import pi, radians, sqrt

from altijax.constants import STANDARD_GRAVITY
from altijax.doppler import DopplerReceiver
from altijax.sensors import Accelerometer, Gyro
from altijax.wheels import WheelSensor

JA_5V = Accelerometer(
    range=20 * STANDARD_GRAVITY,
    noise_density=5e-6 * STANDARD_GRAVITY,
    bias_random_walk=1e-6 * STANDARD_GRAVITY,
    bandwidth=100.0,
    resolution=20 / 2**16 / 5 * STANDARD_GRAVITY,
)
"""Servo accelerometer JA-5V of Japan Aviation Electronics, with the A/D converter of the experiment.

range               20 g: ISPRS 2004. The converter assumed below would end at 2 g, which a cart does not reach.
noise_density       assumed 5 ug/sqrt(Hz), common for servo accelerometers; the transcription of ISPRS 2004 lost the
                    exponent of the resolution.
bias_random_walk    assumed 1 ug/sqrt(s), 60 ug in an hour: warmed up for hours, [shirai2000] section 4.2.
bandwidth           assumed 100 Hz, the low pass before the converter; vehicles hold little above it.
resolution          assumed 16 bits over +-10 V at 5 V/g (sensitivity: ISPRS 2004). With 12 bits half a step, 0.005
                    m/s^2, could make 0.7 m in the 17 s of [shirai2000] table 2, whose elevations are 0.03 to 0.06 m.
Tolerances: scale 3 %, lateral sensitivity 0.01 % (ISPRS 2004); zero point 0.01, of a unit lost in transcription.
"""

VIBRATION_GYRO = Gyro(
    range=radians(90.0),
    noise_density=radians(0.1) / sqrt(pi / 2 * 7),
    bias_random_walk=radians(10 / 60) / 60,
    bandwidth=7.0,
)
"""Piezoelectric vibration gyro with the figures of a Murata ENV-05A.

range, bandwidth    90 deg/s, 7 Hz: ISPRS 2004.
noise_density       0.030 deg/s/sqrt(Hz), from the resolution of 0.1 deg/s (ISPRS 2004).
bias_random_walk    assumed: in an hour as far as the drift below.
Tolerances: drift of 3 to 15 deg/min, 10 on average, measured with the sister type ENV-05H (a report that the web page
gzwg.blogspot.com/2009/03/murata-env-05h-vibrating-gyroscope.html quotes without naming it).
"""

FIBRE_OPTIC_GYRO = Gyro(
    range=radians(90.0),
    noise_density=radians(0.06) / sqrt(pi / 2 * 20),
    bias_random_walk=radians(1 / 60) / 60,
    bandwidth=20.0,
)
"""Fibre-optic gyro with the figures of a Japan Aviation Electronics JG-35FD.

range, bandwidth    90 deg/s, 20 Hz: ISPRS 2004.
noise_density       0.011 deg/s/sqrt(Hz), from the resolution of 0.06 deg/s (ISPRS 2004).
bias_random_walk    assumed: a tenth of the vibration gyro's.
Tolerances: drift assumed 1 deg/min, a tenth of the vibration gyro's.
"""

ND_PG1 = WheelSensor(radius=0.33, track_width=0.6, pulses_per_turn=2)
"""Pioneer ND-PG1 speed pulse generators on both wheels of the cart, two magnets in each tyre.

pulses_per_turn     2: [shirai2000] section 3.
radius              assumed: a 26 inch tyre, common on Japanese carts: 1.04 m from pulse to pulse. The printed ways do
                    not tell: were they numbers of steps (the mean of two wheels gains half a pulse distance), one
                    step would divide 9.979, 168.510, 164.850, 167.082 and 166.224 m. Of all steps from 0.25 to 0.56 m
                    (radii of 0.16 to 0.36 m) the best, 0.454 m, is off by 0.07 of a step where the digits allow 0.002,
                    and 28 % of random ways fit as well. So the printed way is no plain count; that five runs of 10.012
                    to 10.078 m all read 9.979 m says that its step is longer than their spread.
track_width         assumed, from the size of such carts.
Tolerances: assumed, magnets 5 mm out of place, which is 0.015 rad, and the radius 1 %, by pressure and load (the
printed ways are 0.5 to 3 % too long outdoors and 0.3 to 1 % too short indoors).
"""

DOPPLER_1_HZ = DopplerReceiver(rate=1.0, horizontal_noise=0.05, vertical_noise=0.1, latency=0.15)
"""Doppler velocity of a 1 Hz receiver, as in [chalko2010].

rate                1 Hz: [chalko2010].
horizontal_noise    0.05 m/s: T. Chalko, Estimating accuracy of GPS Doppler speed measurement (2009), has means of 10 s
                    better than 0.05 m/s at 99.9 % from a GT-31, which is 3.3 times 0.05 / sqrt(10); a u-blox ZED-F9P is
                    specified at 0.05 m/s.
vertical_noise      assumed twice the horizontal one, as satellites are seen on one side only.
correlation_time    assumed zero, as the means of 10 s above need.
latency             assumed 0.15 s: 0.11 to 0.22 s are met in real logs.
dropout_probability assumed zero, under open sky.
"""

MEMS_ACCELEROMETER = Accelerometer(
    range=2 * STANDARD_GRAVITY,
    resolution=STANDARD_GRAVITY / 16384,
    noise_density=400e-6 * STANDARD_GRAVITY,
    bias_temperature=35e-3 / 70 * STANDARD_GRAVITY,
    scale_temperature=0.02e-2,
    bias_random_walk=1e-4,
    bandwidth=42.0,
)
"""Consumer MEMS accelerometer: InvenSense MPU-6050, product specification PS-MPU-6000A-00 revision 3.4, section 6.2.

range, resolution   2 g, 16384 steps per g.
noise_density       400 ug/sqrt(Hz).
bias_temperature    35 mg over 0 to 70 degC on x and y, taken as linear; z has 60 mg.
scale_temperature   0.02 % per K.
bias_random_walk    assumed 1e-4 m/s^2/sqrt(s), 0.6 mg in an hour.
bandwidth           assumed 42 Hz, a setting within the programmable 5 to 260 Hz that suits 100 Hz sampling.
Tolerances: zero 50 mg on x and y, 80 mg on z; scale 3 %; cross-axis 2 %.
"""

MEMS_GYRO = Gyro(
    range=radians(250.0),
    resolution=radians(1 / 131),
    noise_density=radians(0.005),
    g_sensitivity=radians(0.1) / STANDARD_GRAVITY,
    bias_temperature=radians(20.0) / 60,
    scale_temperature=0.02 / 60,
    bias_random_walk=radians(1.2e-4),
    bandwidth=42.0,
)
"""Consumer MEMS gyro: InvenSense MPU-6050, product specification PS-MPU-6000A-00 revision 3.4, section 6.1.

range, resolution   250 deg/s, 131 steps per deg/s.
noise_density       0.005 deg/s/sqrt(Hz); with 100 Hz of band the same table has 0.05 deg/s, so it is one-sided.
g_sensitivity       0.1 deg/s/g; assumed alike for all pairs of axes.
bias_temperature    20 deg/s over -40 to 85 degC, taken as linear about 25 degC; the worst, a good unit has a tenth.
scale_temperature   2 % over the same.
bias_random_walk    assumed: in 100 s 0.0012 deg/s, the bias instability that robotics.stackexchange.com/questions/8860
                    has measured.
bandwidth           assumed 42 Hz, a setting within the programmable 5 to 256 Hz that suits 100 Hz sampling.
Tolerances: zero 20 deg/s; scale 3 %; cross-axis 2 %.
"""
