"""What is wrong with what a cell file asks of the cyclic modes."""
