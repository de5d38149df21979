"""Named inputs and outputs of a cell, looked up in the files of its nodes."""
