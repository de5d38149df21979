"""One axis: its image, its order, its states, and how commands are accepted and run."""
