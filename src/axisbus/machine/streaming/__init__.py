"""Set-points from a program while its axes move: streams of points, and the answers of its own control loops."""
