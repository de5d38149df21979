"""Parts of the benchmarks of the cycle: a line to drives in another process, and the masters that control them."""
