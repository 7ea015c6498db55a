"""What an optopad sensor is: specification, catalogue, layout, geometry, rules."""
