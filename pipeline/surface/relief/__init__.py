"""Relief of rock: joints, noise and their spectra."""
