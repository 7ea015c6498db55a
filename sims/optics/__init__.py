"""Light: rays from every emitter to every receiver through the deformed pad."""
