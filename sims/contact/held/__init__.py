"""Presses of rigid objects of any form into the pad: unilateral contact of a height map with a linear layer."""
