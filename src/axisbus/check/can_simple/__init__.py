"""What can be found wrong with modules that speak CAN Simple before the first frame."""
