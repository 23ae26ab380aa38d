"""Connects a ball-on-plate rig in ROS 2 to offbd."""
