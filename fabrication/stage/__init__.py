"""The stage that presses the pad: driver, simulation, unattended collection. It needs neither CAD nor physics."""
