"""One mine by two models: a level plan, and a closed volume."""
