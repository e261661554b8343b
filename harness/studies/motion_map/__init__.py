"""Maps of what the motions of an oscillator end in, over one or two parameters."""
