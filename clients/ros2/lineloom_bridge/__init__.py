"""The ROS 2 node of a robot of a Lineloom site; what it does is in `lineloom.bridge`."""
