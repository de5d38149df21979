"""The data between a program and a core in a process of its own, as bytes: values, errors, messages and the process image."""
