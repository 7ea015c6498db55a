"""The stage that presses the pad: its driver, a simulated stage, unattended collection of data."""
