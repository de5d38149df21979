"""Ways of which the axes' positions are given by samples: what a program's own kinematics make of a line, a corner or a circle."""
