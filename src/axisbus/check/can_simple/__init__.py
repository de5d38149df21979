"""The checks of modules that speak CAN Simple, before the first frame is sent."""
