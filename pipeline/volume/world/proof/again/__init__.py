"""What follows from a volume's mesh, legs and rock, made again: labels, model, lights, plan, texture."""
