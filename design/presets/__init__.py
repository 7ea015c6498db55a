"""Ready designs, as the commented files that `optopad new` hands out."""
