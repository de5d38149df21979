"""What a cell file may say of an axis without a drive, and what that means for motion."""
