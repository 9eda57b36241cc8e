"""A ROS robot as a robot of a Lineloom site, whatever carries its messages.

`robot_bridge` is the whole of it on plain values; who has messages (the ROS 2 node in
`clients/ros2`, DDS and Zenoh here) gives it `ports` to send and to ask by.
"""
