"""Frames of volumetric video as messages: see :mod:`isv_ros.messages`, which needs no ROS."""
