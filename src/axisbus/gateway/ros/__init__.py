"""ROS 2 over a Zenoh session, compatible with rmw_zenoh: joint states of a machine, and joint trajectories for it."""
