"""What a bundle of a world that is one volume may hold."""
