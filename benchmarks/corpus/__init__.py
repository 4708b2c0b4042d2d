"""The corpus: worlds with their certificates, reports and pictures in one folder that others can load by name."""
