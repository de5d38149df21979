"""The report about the drive of axis x after another process has stopped it, as a regular expression."""

# With 605Ah from 1 to 4 a drive goes to switch on disabled once it is at standstill. The report may come before that.
STOPPED = "x: (is at standstill, held in quick stop|stopped, power is off)"
