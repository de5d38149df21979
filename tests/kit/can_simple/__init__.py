"""What the tests of an axis over CAN Simple share: modules in virtual time under the scan, and a look at their plants."""
