"""The CAN adapter and the layer on it: frames in and out, bus-off, listening, candump recordings."""
