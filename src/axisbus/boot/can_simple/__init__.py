"""Bringing a module up that speaks CAN Simple: who it is, what it does, and how it will stop."""
