"""The part of a cell file about modules that speak CAN Simple."""
