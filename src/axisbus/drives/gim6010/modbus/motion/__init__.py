"""Motion over Modbus: a module is enabled, led by its own trapezoid or by set-points, and stopped on every way out."""
