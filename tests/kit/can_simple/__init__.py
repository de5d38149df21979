"""Shared code of the tests of an axis over CAN Simple: modules in virtual time under the scan, and a look at their plants."""
