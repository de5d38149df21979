"""The settings of an axis without a drive in a cell file, and its parameters for motion."""
