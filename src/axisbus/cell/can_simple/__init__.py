"""What a cell file says of a module that speaks CAN Simple."""
