"""Path segments given by samples of the axes' positions, for lines, corners and circles of a user's own kinematics."""
