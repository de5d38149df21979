"""``axisbus gim6010 termination``, ``limits``, ``watchdog``, ``zero`` and ``set-bitrate``: what is set in a module."""
