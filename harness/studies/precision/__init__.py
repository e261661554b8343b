"""What accuracy costs: work-precision, model error, external anchors."""
