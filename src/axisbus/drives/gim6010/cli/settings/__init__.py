"""``axisbus gim6010 termination``, ``limits``, ``watchdog``, ``zero`` and ``set-bitrate``: the settings of a module."""
