"""Motion over Modbus: enable a module, move it by its own trapezoid or by set-points, and stop it however a command ends."""
