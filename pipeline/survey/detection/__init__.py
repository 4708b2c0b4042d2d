"""What `new` finds out about a survey of one kind: its scale, its unit, its origin, what is drawn on it."""
