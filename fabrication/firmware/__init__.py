"""Firmware of exactly this geometry: the generated `config.h`, the sketch folder, its compilation and its upload."""
