"""What a trained model needs to answer: numpy and the standard library only, so that the driver runs it anywhere."""
