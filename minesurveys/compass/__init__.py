"""Compass projects (.mak) and survey data (.dat, .clp), brought to Survex's form."""
