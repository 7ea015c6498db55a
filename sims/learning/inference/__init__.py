"""Prediction by a trained model. It needs only numpy and the standard library, so the driver can run it anywhere."""
