"""The differences between Linux, macOS and Windows: one module for each need, which every system can import."""
