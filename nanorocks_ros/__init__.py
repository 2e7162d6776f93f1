"""Coefficient of restitution, with an honest interval, from films of a granular gas."""

from nanorocks_ros.limits import bound_opencv

__version__ = '0.1.0'

# Before the first import of OpenCV, which reads its limit only once.
bound_opencv()
