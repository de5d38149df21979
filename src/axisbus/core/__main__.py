"""The process that a program starts for its core (``core.process.launch``): a watchdog process, which starts further processes.

The argument is a ``StartupArgs`` as JSON.
"""

from __future__ import annotations

import sys

if __name__ == "__main__":
    from axisbus.core.process.watchdog_process import main

    main(sys.argv[1])
