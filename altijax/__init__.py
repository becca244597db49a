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

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

# Only where the user has said so by the environment: otherwise importing altijax leaves jax's configuration alone.
if os.environ.get("ALTIJAX_KEEP_PROGRAMS"):
    import_module("altijax.programs").keep_programs_as_told()
