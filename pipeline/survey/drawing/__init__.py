"""Pictures of plans: what they show, and their scale."""
