"""Physical constants as Python floats, so that they take on the precision of the arrays they meet."""

STANDARD_GRAVITY = 9.80665
"""m/s^2, exact. 3rd General Conference on Weights and Measures (1901), resolution 2."""

GAL = 0.01
"""m/s^2, exact: 1 cm/s^2. The SI Brochure, 9th edition (2019)."""

KNOT = 1852 / 3600
"""m/s, exact: one nautical mile of 1852 m an hour. The SI Brochure, 9th edition (2019)."""

WGS84_SEMI_MAJOR_AXIS = 6378137.0
"""m, exact. NGA.STND.0036 (WGS 84, 2014), table 3.1."""

WGS84_FLATTENING = 1 / 298.257223563
"""1, exact. NGA.STND.0036 (WGS 84, 2014), table 3.1."""

WGS84_GRAVITATIONAL_PARAMETER = 3.986004418e14
"""m^3/s^2, exact. NGA.STND.0036 (WGS 84, 2014), table 3.1."""

EARTH_ROTATION_RATE = 7.292115e-5
"""rad/s, exact. NGA.STND.0036 (WGS 84, 2014), table 3.1."""

WGS84_EQUATORIAL_GRAVITY = 9.7803253359
"""m/s^2. Normal gravity on the ellipsoid at the equator, NGA.STND.0036 (2014), table 3.6."""

WGS84_POLAR_GRAVITY = 9.8321849379
"""m/s^2. Normal gravity on the ellipsoid at the poles, NGA.STND.0036 (2014), table 3.6."""
