"""``axisbus gim6010 modbus``: a module on RS485, by its registers."""
