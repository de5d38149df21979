"""``python -m axisbus``."""

from axisbus.cli.main import main

if __name__ == "__main__":
    main()
