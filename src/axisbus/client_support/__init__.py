"""Support for programs that let clients use a machine: message rate limits, the dead-man of a jog, access to objects."""
