"""What crosses between a program and a core in a process of its own, as bytes: values, errors, messages and the image."""
