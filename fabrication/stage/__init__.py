"""The machine that presses the pad at the bench: driven, simulated, left alone. Neither CAD nor physics."""
