"""What tests of Modbus share: a wire in virtual time, and modules on it."""
