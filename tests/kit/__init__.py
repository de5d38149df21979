"""What tests share: cells with stand-ins behind them, and the probe of the plants that scenarios assert on."""
