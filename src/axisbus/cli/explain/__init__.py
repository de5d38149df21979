"""``axisbus explain``: the pages of the symptoms, in a terminal."""
