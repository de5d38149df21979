"""What every program at a machine needs that serves others: rates, the dead-man of a jog, objects read and written in passing."""
