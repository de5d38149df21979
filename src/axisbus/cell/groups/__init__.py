"""What a cell file may say of the axes of a group together."""
