"""A ROS 2 robot as a robot of a Lineloom site.

`node` alone knows ROS; everything else works on plain values, and is tested without it.
"""
