"""The fixtures of axisbus for the tests in this folder."""

pytest_plugins = ["axisbus.testing"]
