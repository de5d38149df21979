"""One axis: its process image, its outputs, its states, and the acceptance and execution of its commands."""
