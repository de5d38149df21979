"""What a program feeds its axes with while they move: streams of points, and the answers of its own loops."""
