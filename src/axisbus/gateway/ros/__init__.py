"""ROS 2 over a session of Zenoh, as rmw_zenoh has it: joint states of a machine, and joint trajectories for it."""
