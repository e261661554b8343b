"""Identification of decays from records or scenes."""
