"""Shared code of the tests: cells with simulated drives behind them, and the probe of the plants that scenarios assert on."""
