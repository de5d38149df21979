"""What the benchmarks of the cycle are made of: a line to drives in another process, and who drives them."""
