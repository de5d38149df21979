"""The common settings of a group's axes in a cell file."""
