"""Prediction by a trained model: numpy and the standard library only, so that the driver runs it anywhere."""
